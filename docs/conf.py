"""How the documentation is built: `python -m sphinx -W --keep-going -j auto -b html docs OUT`.

Every page is run while it is built (`python_blocks`): what it shows is what its code gave. The built pages ask nothing
of any other machine.
"""

import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
# This copy of refsim, also in the kernels that run the pages; and the reader of the pages
sys.path.insert(0, str(HERE))
sys.path.insert(0, str(HERE.parent))
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(HERE.parent), os.environ.get("PYTHONPATH"))))

import refsim  # noqa: E402

project = "refsim"
author = "The refsim developers"
release = version = refsim.__version__
project_copyright = author

extensions = ["myst_nb", "sphinx.ext.autodoc", "docstrings"]
exclude_patterns = ["_build", "jupyter_execute"]
language = "en"

# Pages are Markdown whose Python blocks run, a kernel a page
nb_custom_formats = {".md": "python_blocks.read"}
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_show_tb = True
# No block keeps a reader who builds the pages waiting for longer than this (seconds; the limit is one block's, not a
# page's). The tests build with 900: on a machine that other work shares, slow is not wrong; no test judges by a clock.
nb_execution_timeout = 60
nb_merge_streams = True
nb_execution_excludepatterns = ["index.md"]
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence"]

# Docstrings mark names with single backticks, as the pages do
default_role = "code"
highlight_language = "none"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "NDArray": "NDArray", "Float32": "Float32"}
python_maximum_signature_line_length = 72
add_module_names = False
suppress_warnings = ["mystnb.unknown_mime_type"]

html_theme = "furo"
html_title = f"refsim {release}"
html_static_path = ["_static"]
html_css_files = ["page.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0072B2", "color-brand-content": "#0072B2"},
    "dark_css_variables": {"color-brand-primary": "#56B4E9", "color-brand-content": "#56B4E9"},
}
