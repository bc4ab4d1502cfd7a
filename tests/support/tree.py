"""The tree in ARCHITECTURE.md, made from the docstrings of what is on disk.

`python -m tests.support.tree` writes it again (`make docs` does).
"""

from __future__ import annotations

import ast
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ARCHITECTURE = ROOT / "ARCHITECTURE.md"
START, END = "<!-- tree:start -->\n```text\n", "```\n<!-- tree:end -->"
_COLUMN = 27

HOUSE = {
    "README.md": "one picture, what it does, two commands",
    "ARCHITECTURE.md": "this tree, the frame graph, the layers, where to put X",
    "CONTRIBUTING.md": "how to set up, the rules, what a review asks",
    "CHANGELOG.md": "what changes for users, and which numbers moved",
    "CITATION.cff": "the paper to cite",
    "LICENSE": "Apache-2.0",
    "Makefile": "the one door: setup check test demo evaluate bench docs",
    "pyproject.toml": "dependencies, extras, lint, types, import contracts",
    ".ci": "run: what CI runs, `make check test`",
    ".gitignore": "",
    ".pre-commit-config.yaml": "local hooks that call the tools of the dev extra",
    "src": "the package, below",
    "tests": "unit (mirrors src), property, golden, e2e; helpers in support",
    "benchmarks": "timings and comparisons that are no tests",
    "examples": "run by the tests",
    "deploy": "a systemd unit and a Containerfile for `boltpose serve`",
    "docs": "conventions, formats, results, adr (why it is so), images",
    "data": "reman18 (simulated) behind every number; models: networks per family left out",
    "results": "records of `boltpose evaluate`, one JSON per motor",
}
"""Every tracked name in the repository's root."""


def render_tree() -> str:
    """The text between the markers."""
    lines = [_line(0, name + ("/" if (ROOT / name).is_dir() else ""), HOUSE[name])
             for name in HOUSE if (ROOT / name).exists() and HOUSE[name]]  # fmt: skip
    lines.append("")
    lines += _folder(ROOT / "src" / "boltpose", 0, "src/boltpose/")
    return "\n".join(lines) + "\n"


def tracked_root_names() -> set[str]:
    """Names in the root that git knows."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return {line.split("/")[0] for line in listed.stdout.splitlines()}


def read_tree() -> str:
    """The text that stands between the markers now."""
    text = ARCHITECTURE.read_text(encoding="utf-8")
    return text.split(START, 1)[1].split(END, 1)[0]


def _folder(folder: Path, depth: int, shown: str) -> list[str]:
    lines = [_line(depth, shown, _first_sentence(folder / "__init__.py"))]
    modules = sorted(path for path in folder.glob("*.py") if path.name != "__init__.py")
    lines += [_line(depth + 1, path.name, _first_sentence(path)) for path in modules]
    for child in sorted(path for path in folder.iterdir() if path.is_dir()):
        if child.name.startswith(("__", ".")):
            continue
        if (child / "__init__.py").exists():
            lines += _folder(child, depth + 1, f"{child.name}/")
        elif any(child.iterdir()):
            lines.append(_line(depth + 1, f"{child.name}/", _DATA_FOLDERS.get(child.name, "")))
    return lines


_DATA_FOLDERS = {
    "demo": "one simulated motor: full scan, view, camera, hand-eye",
    "weights": "the shipped networks (ONNX), each with its model card",
}


def _first_sentence(path: Path) -> str:
    if not path.exists():
        return ""
    docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return docstring.split("\n\n")[0].replace("\n", " ").strip().rstrip(".")


def _line(depth: int, name: str, text: str) -> str:
    return f"{'  ' * depth}{name}".ljust(_COLUMN) + f" {text}".rstrip()


if __name__ == "__main__":
    before, rest = ARCHITECTURE.read_text(encoding="utf-8").split(START, 1)
    after = rest.split(END, 1)[1]
    ARCHITECTURE.write_text(before + START + render_tree() + END + after, encoding="utf-8")
