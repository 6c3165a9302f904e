"""The site of the documentation: `tools/site` makes it from these pages and from the docstrings."""

from obseq import __version__

project = "obseq"
author = "The obseq authors"
version = release = __version__
language = "en"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_external_toc",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["changelog.d", "notebooks", "gallery"]
suppress_warnings = ["etoc.toctree", "myst.header"]
external_toc_path = "contents.yml"

html_theme = "furo"
html_title = f"obseq {__version__}"
html_show_sphinx = False
html_show_sourcelink = False
html_theme_options = {"top_of_page_buttons": []}

myst_enable_extensions = ["deflist"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

autodoc_default_options = {"members": True, "member-order": "bysource", "exclude-members": "__init__"}
napoleon_use_ivar = True
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
add_module_names = False
toc_object_entries_show_parents = "hide"
nitpicky = False  # types of arrays and of other libraries have no page here

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "pictured",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "min_reported_time": 60,
}
