"""The command line: parses and prints, nothing else.

    refsim render METHOD SCENE      refsim scenes      refsim doctor      refsim reproduce

Exit codes: 0 fine, 1 something is wrong (doctor, reproduce), 2 cannot (bad input), 130 interrupted. A refusal is one
line on stderr that names the culprit. Whatever a command needs is imported inside it, so that help and refusals are
instant.
"""

from __future__ import annotations

import difflib
import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import click

from refsim.cli_options import Place, Size, method_options
from refsim.errors import InputError

WRONG = 1
CANNOT = 2
INTERRUPTED = 130
TOPICS = ("hre", "gsr", "bsh", "pipeline", "across")
BROKEN_PIPE = 141  # what a shell reports for a program that SIGPIPE ended


as_json = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


def print_version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print name and version, and stop."""
    if wanted and not ctx.resilient_parsing:
        import refsim

        click.echo(f"refsim {refsim.__version__}")
        ctx.exit()


class Commands(click.Group):
    """A group that, asked for a command that it lacks, names the nearest or all."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command of `args`."""
        if args[0] not in self.commands and not args[0].startswith("-"):
            near = difflib.get_close_matches(args[0], self.commands, 1)
            mend = f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(self.commands)}."
            raise InputError(f"there is no command {args[0]!r}; {mend}")
        return super().resolve_command(ctx, args)


@click.group(cls=Commands, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=print_version, help="Show version."
)
@click.pass_context
def commands(ctx: click.Context) -> None:
    """Run the ray tracers of three papers on a simulated graphics pipeline, and count everything."""
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


@commands.command()
@click.argument("method")
@click.argument("scene")
@click.option("--size", type=Size(), default="256", show_default=True, metavar="N|WxH", help="Size in pixels.")
@click.option("--out", type=Place(), metavar="FILE", help="The PNG to write; SCENE.png if not given.")
@method_options
@as_json
def render(method: str, scene: str, size: tuple[int, int], out: Path | None, as_json: bool, **options: object) -> None:
    """Render SCENE with METHOD.

    SCENE is a name that `refsim scenes` lists, or a PLY, OBJ, STL or GLB file. METHOD is geometry_shader,
    fragment_grid, traversal_list, ray_engine, hierarchical_ray_engine or brute_force. NAME_on_ground puts any named
    scene above a ground with a light.
    """
    from refsim.counters import REGISTRY
    from refsim.image import check_destination, write_png
    from refsim.progress import progress

    path = out or Path(f"{Path(scene).stem}.png")
    check_destination(path)
    given = {name: value for name, value in options.items() if value is not None}

    started = time.perf_counter()
    import refsim

    with progress(None, f"{method} on {scene}"):
        image = refsim.render(method, scene, *size, **given)  # type: ignore[arg-type]  # checked by the method
    rendered = time.perf_counter()
    write_png(path, image.rgb)
    written = time.perf_counter()

    seconds = {"render": round(rendered - started, 4), "write": round(written - rendered, 4)}
    counters = {name: int(value) for name, value in image.trace.counters.items()}
    if as_json:
        head = {"method": method, "scene": scene, "width": size[0], "height": size[1], "options": given}
        print_json({**head, "counters": counters, "seconds": seconds, "image": str(path)})
        return
    click.echo(f"{method} on {scene}, {size[0]} x {size[1]}: {path} in {seconds['render']:.2f} s")
    print_table([(name, f"{value:,} {REGISTRY[name].unit}") for name, value in counters.items()])


@commands.group(cls=Commands, invoke_without_command=True)
@as_json
@click.pass_context
def scenes(ctx: click.Context, as_json: bool) -> None:
    """List scenes and real meshes.

    The meshes are those in the folder that REFSIM_SCENES names, or where it is not set in the user's cache; known ones
    that it lacks read `missing`, and `refsim scenes fetch NAME` gets some from where they were first published.
    """
    if ctx.invoked_subcommand is not None:
        return
    from refsim import doctor

    listing = doctor.scenes()
    if as_json:
        print_json(listing)
    else:
        print_table(doctor.scene_rows(listing))


@scenes.command()
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@click.option("--to", type=Place(), metavar="FOLDER", help="Where the meshes go.")
@click.option("--force", is_flag=True, help="Replace a file of that name that is not the mesh.")
def fetch(names: tuple[str, ...], to: Path | None, force: bool) -> None:
    """Fetch real meshes from their original archives.

    What comes is checked against the SHA-256 that refsim knows, and put in place whole or not at all: in the folder
    that REFSIM_SCENES names, or where it is not set in the user's cache (~/.cache/refsim/scenes), which is then
    searched instead. NAME is bunny, dragon, dragon_res2, dragon_res3, dragon_res4 or horse. Needs the package pooch:
    pip install 'refsim[fetch]'.
    """
    from refsim.progress import progress
    from refsim.scene.fetch import fetch_meshes

    for got in fetch_meshes(names, to, force=force, progress=progress):
        click.echo(f"{got.path}: {'was there already, and is right' if got.already_there else 'fetched and checked'}")
        told = {"triangles": f"{got.mesh.triangles:,}", "source": got.mesh.source, "archive": got.original.url}
        print_table([*told.items(), ("credit", got.original.credit), ("terms", got.original.terms)])


@commands.command()
@as_json
@click.pass_context
def doctor(ctx: click.Context, as_json: bool) -> None:
    """Say what refsim finds here.

    The exit code is 1 if something that refsim needs is wrong, a missing mesh or tool not included.
    """
    from refsim import doctor as examination

    report = examination.examine()
    if as_json:
        print_json(report)
    else:
        print_table(examination.rows(report))
    ctx.exit(1 if report["problems"] else 0)


@commands.command()
@click.argument("topic", type=click.Choice(TOPICS), required=False, metavar="[TOPIC]")
@click.option("--quick", is_flag=True, help="Smaller sizes, in four minutes at most.")
@click.option("--only", multiple=True, metavar="ID", help="One figure or table; may be given several times.")
@click.option(
    "--out",
    type=Place(),
    metavar="DIR",
    help="Where pictures and the CSV behind each go; figures, or figures-quick with --quick, if not given.",
)
@click.option("--jobs", type=click.IntRange(1, 1024), metavar="N", help="Processes; one a processor if not given.")
@click.option(
    "--backend",
    type=click.Choice(["joblib", "dask"]),
    default="joblib",
    show_default=True,
    help="What runs them: joblib here, or the Dask cluster of DASK_SCHEDULER_ADDRESS, else one made here.",
)
@click.option("--accept", is_flag=True, help="Make the verdicts and rows of this run the committed ones.")
@click.pass_context
def reproduce(
    ctx: click.Context,
    topic: str | None,
    quick: bool,
    only: tuple[str, ...],
    out: Path | None,
    jobs: int | None,
    backend: str,
    accept: bool,
) -> None:
    """Make figures and tables again, and judge what the papers claim.

    TOPIC is hre, the paper on the Hierarchical Ray Engine, gsr, the one on ray tracing in the geometry shader, bsh,
    the one on traversal lists of bounding spheres, pipeline, what a draw does stage by stage, or across, what compares
    the papers; without it, everything is made, with report.json. Each figure or table is a picture and the CSV behind
    it. A run that was stopped goes on where it was when it is started again.

    The exit code is 1 if a verdict, or a row behind it, is not the committed one.
    """
    from refsim import experiments
    from refsim.progress import progress

    # The committed figures are full ones: quick ones never take their place unasked
    folder = out or Path("figures-quick" if quick else "figures")
    outcome = experiments.Outcome(quick, folder)
    for path in experiments.reproduce(
        topic,
        quick=quick,
        only=only or None,
        out=folder,
        progress=progress,
        jobs=jobs or experiments.processors(),
        backend=backend,
        outcome=outcome,
    ):
        click.echo(path)
    judgement, paths = experiments.conclude(outcome, accept=accept)
    for path in paths:
        click.echo(path)
    print_table(experiments.summary_rows(judgement))
    for sentence in judgement.differs:
        click.echo(f"refsim: {' '.join(sentence.split())}", err=True)
    ctx.exit(WRONG if judgement.differs else 0)


def print_json(value: object) -> None:
    """Print ``value`` as one JSON object."""
    click.echo(json.dumps(value, indent=2))


def print_table(rows: Sequence[tuple[str, str]]) -> None:
    """Print names and values in two columns; on a terminal the names are dim."""
    width = max((len(name) for name, _ in rows), default=0)
    for name, value in rows:
        click.echo(f"  {click.style(name.ljust(width), dim=True)}  {value}")


def refuse(message: str) -> int:
    """Say on one line of stderr why nothing was done."""
    click.echo(f"refsim: {' '.join(message.split())}", err=True)
    return CANNOT


def explained(error: OSError) -> str:
    """The system's refusal in words, with the file if it names one; a full disk behind stdout has no name."""
    reason = error.strerror or str(error) or type(error).__name__
    return f"{error.filename!r}: {reason}" if error.filename else reason


def run(arguments: Sequence[str]) -> int:
    """Parse, run, and return the exit code; click's own main() would print usage blocks and empty lines of its own."""
    try:
        with commands.make_context("refsim", list(arguments)) as ctx:
            commands.invoke(ctx)
    except click.exceptions.Exit as end:
        return end.exit_code
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """The command ``refsim`` with ``arguments``, the process's own if None; returns its exit code."""
    try:
        return run(sys.argv[1:] if arguments is None else arguments)
    except click.ClickException as error:
        return refuse(error.format_message())
    except InputError as error:
        return refuse(str(error))
    except (KeyboardInterrupt, click.exceptions.Abort):
        click.echo("refsim: interrupted", err=True)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader has gone: nobody is left to tell, not even by the flush at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except OSError as error:
        return refuse(explained(error))
