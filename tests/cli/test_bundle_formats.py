"""`obseq bundle` on files of other programs."""

import bz2

import numpy as np

from obseq.cli.main import main
from obseq.formats.bal.reader import bal_text, read_bal


def test_bal_in_bal_out(tmp_path, shared_data):
    source = next((shared_data / "bal-trafalgar-21").glob("*.bz2"), None)
    if source is None:
        source = next((shared_data / "bal-trafalgar-21").glob("*.txt"))
    text = (bz2.decompress(source.read_bytes()) if source.suffix == ".bz2" else source.read_bytes()).decode()
    block = read_bal(source)
    assert np.array(bal_text(block).split()[:3], dtype=int).tolist() == [21, 11315, 36455]
    (tmp_path / "again.txt").write_text(bal_text(block))
    numbers, again = (np.array(t.split(), dtype=float) for t in (text, (tmp_path / "again.txt").read_text()))
    assert len(again) == len(numbers)
    np.testing.assert_allclose(again[-3 * 11315 :], numbers[-3 * 11315 :], rtol=1e-14)
    cameras = slice(3 + 4 * 36455, 3 + 4 * 36455 + 9 * 21)
    np.testing.assert_allclose(again[cameras], numbers[cameras], rtol=1e-9, atol=1e-12)


def test_a_script_of_dbat_is_a_block(shared_data, capsys):
    assert main(["bundle", f"--dbat={shared_data / 'dbat-sxb/sxb.xml'}"]) in (0, 1)
    said = " ".join(capsys.readouterr().out.split())
    assert "sigma0 1.179 " in said and "are replaced" not in said


def test_a_sigma_for_measures_that_have_their_own_replaces_them_with_a_note(shared_data, capsys):
    given = ["bundle", f"--dbat={shared_data / 'dbat-sxb/sxb.xml'}"]
    assert main([*given, "--image-sigma=0.5"]) in (0, 1)
    said = capsys.readouterr()
    assert "Note: the sigmas of the files are replaced by 0.5 px" in said.out
    assert ", sigma 0.5 px" in said.err
