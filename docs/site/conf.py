"""The site of scripts/docs.sh: how Sphinx reads the guides. The script gives the version and the folders."""

import os
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from docutils import nodes
from sphinx import addnodes

ROOT = Path(__file__).resolve().parents[2]

project = "Doppel"
copyright = "the authors of Doppel, Apache License 2.0"
extensions = ["myst_parser"]
exclude_patterns = ["docs/site", "README.md", "tests", "benchmarks", "examples", "configs", "**/node_modules"]
myst_heading_anchors = 4
highlight_language = "none"  # of blocks that name no language: equations, mostly
suppress_warnings = ["misc.highlighting_failure"]  # a block may leave parts out, as "..."

html_theme = "furo"
html_copy_source = False
html_static_path = ["site.css"]
html_css_files = ["site.css"]
templates_path = ["."]
html_sidebars = {"**": ["sidebar/scroll-start.html", "sidebar/brand.html", "sidebar/search.html",
                        "sidebar/navigation.html", "api_link.html", "sidebar/scroll-end.html"]}

LANGUAGES = {".h": "cpp", ".cpp": "cpp", ".c": "c", ".py": "python", ".yaml": "yaml", ".sh": "bash"}
linked_sources = set()


def api_pages(tags):
    """The page of each header that Doxygen has read."""
    files = ElementTree.parse(tags).getroot().iterfind("compound[@kind='file']")
    return {os.path.relpath(file.findtext("path") + file.findtext("name"), ROOT): "api/" + file.findtext("filename")
            for file in files}


def link_sources(app, doctree):
    """Guides link to files and folders of the tree, as they are read there.

    A link to a header leads to its API page, to another file to a page that shows it, to a folder to the page of the
    folder, and without such a page it is plain text.
    """
    folder = os.path.dirname(app.env.docname)

    def in_tree(target):
        return os.path.normpath(os.path.join(folder, target))

    def from_here(path):
        return os.path.relpath(path, folder or ".")

    for node in list(doctree.findall(addnodes.download_reference)):
        path = in_tree(node["reftarget"])
        if path not in app.api_pages:
            linked_sources.add(path)
        uri = from_here(app.api_pages.get(path, f"source/{path}.html"))
        node.replace_self(nodes.reference("", "", *node.children, refuri=uri, internal=True))
    for node in list(doctree.findall(addnodes.pending_xref)):
        file, mark, heading = node["reftarget"].partition("#")
        path = in_tree(file)
        if file and path == "README.md":
            node["reftarget"] = from_here("index.md") + mark + heading
        elif file and (ROOT / path).is_dir():
            pages = [page for page in (f"{path}/README", os.path.basename(path)) if page in app.env.found_docs]
            if pages:
                node["reftarget"] = from_here(f"{pages[0]}.md")
            else:
                node.replace_self(node.children)


def source_pages(app):
    for path in sorted(linked_sources):
        file = ROOT / path
        code = app.builder.highlighter.highlight_block(file.read_text(), LANGUAGES.get(file.suffix, "none"))
        body = f"<h1>{file.name}</h1><p><code>{path}</code></p>{code}"
        yield f"source/{path}", {"title": path, "body": body}, "page.html"


def setup(app):
    app.api_pages = api_pages(os.environ["DOPPEL_API_TAGS"])
    app.connect("doctree-read", link_sources, priority=100)  # before Sphinx copies the files of such links
    app.connect("html-collect-pages", source_pages)
