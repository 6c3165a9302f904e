"""Make the three links in src/obseq/ that let type checkers and editors see the installed package.

They do not run import hooks, so they cannot follow the package map of an editable install. The links are
ignored by git; nothing at run time needs them. Run it again at any time.
"""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("formulas", "codegen", "generated")


def main() -> None:
    """Link each folder; refuse to replace anything that is not a link."""
    for folder in FOLDERS:
        link = ROOT / "src" / "obseq" / folder
        if link.is_symlink():
            link.unlink()
        link.symlink_to(Path("..") / ".." / folder, target_is_directory=True)


if __name__ == "__main__":
    main()
