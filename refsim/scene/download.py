"""``downloader``: a function that brings a file from the network, with pooch, and one sentence for whatever goes wrong.

pooch and what it stands on are imported only here, and only when something is to be fetched
(`pip install 'refsim[fetch]'`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from refsim.errors import InputError

__all__ = ["Download", "Report", "downloader"]

Report = Callable[[float | None, str], AbstractContextManager[Callable[..., None]]]
# Seconds without a byte after which a server is given up.
TIMEOUT = 30.0
Download = Callable[[str, Path, Report | None, str], Path]


def downloader() -> Download:
    """``download(url, file, progress, title)``, which leaves the whole of ``url`` at the path ``file`` or raises.

    ``InputError`` where pooch is not installed, and from ``download`` for an answer that is none; what the operating
    system refuses stays an ``OSError``. ``progress`` hears of every chunk's bytes.
    """
    try:
        import pooch
        import requests
    except ImportError:
        raise InputError("fetching needs the package pooch: pip install 'refsim[fetch]'") from None
    problems = requests.exceptions

    def download(url: str, file: Path, progress: Report | None, title: str) -> Path:
        pooch.get_logger().setLevel("ERROR")
        told = progress(None, title) if progress else contextlib.nullcontext(lambda steps=1: None)
        seen = _Bytes()
        cut_off = InputError(f"the download of {url} was cut off; try again")
        try:
            with told as advance:
                seen.advance = advance
                http = pooch.HTTPDownloader(progressbar=seen, timeout=TIMEOUT)
                pooch.retrieve(url, known_hash=None, fname=file.name, path=file.parent, downloader=http)
        except problems.HTTPError as error:
            raise InputError(f"{url} cannot be had: the server answers {_answer(error.response)}") from None
        except (problems.ChunkedEncodingError, problems.ContentDecodingError):
            raise cut_off from None
        except problems.Timeout:
            raise InputError(f"{url} cannot be had: the server does not answer in time") from None
        except problems.SSLError:
            raise InputError(f"{url} cannot be had: the server's certificate is not to be trusted") from None
        except problems.ConnectionError:
            # requests says the same of no network at all and of a stream that stops
            unreachable = InputError(f"{url} cannot be reached: is there a network?")
            raise (unreachable if seen.total is None else cut_off) from None
        except problems.RequestException as error:
            raise InputError(f"{url} cannot be had: {error}") from None
        return file

    return download


class _Bytes:
    """What pooch takes for a progress bar: it sets ``total`` when the answer has begun, and tells of chunks."""

    def __init__(self) -> None:
        self.total: int | None = None
        self.advance: Callable[..., None] = lambda steps=1: None

    def update(self, count: int) -> None:
        self.advance(count)

    def reset(self) -> None:
        # pooch starts anew at the end, to fill the bar exactly; ours goes only forward.
        self.advance = lambda steps=1: None

    def close(self) -> None:
        pass


def _answer(response: Any) -> str:
    return f"{response.status_code} {response.reason}" if response is not None else "with an error"
