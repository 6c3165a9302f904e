import subprocess
import sys

import pytest

from obseq.cli.gencode import main


def test_it_is_the_generator(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["gencode", "--list"])
    assert main() == 0
    assert "TopoHz" in capsys.readouterr().out.split()


@pytest.mark.parametrize(
    ("what", "who"),
    [
        ("from obseq.cli.gencode import main; sys.exit(main())", "gencode: obseq.formulas"),
        ("from obseq.formulas import Formula", "obseq.errors.MissingPackageError: obseq.formulas"),
        ("from obseq.codegen import compile_formula", "obseq.errors.MissingPackageError: obseq.codegen"),
    ],
)
def test_without_the_generator_it_says_what_to_install(what: str, who: str) -> None:
    script = f"import sys\nsys.modules['sympy'] = None\n{what}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == (2 if "main" in what else 1)
    last = done.stderr.strip().splitlines()[-1]
    assert last.replace("codegen", "formulas").startswith(who.replace("codegen", "formulas"))
    both = "pip install 'obseq[gencode]' (in a checkout: pip install -e '.[gencode]')"
    assert last.endswith(f" needs sympy; install with: {both}")
