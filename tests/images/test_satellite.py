"""Blocks of satellite images: files of coefficients, corrections, check points."""

import numpy as np
import pytest
import satellites

from obseq import crs
from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats.rpc.files import image_of, read_rpc, rpc_text
from obseq.images import ControlPoints
from obseq.images.satellite.block import GEOGRAPHIC, SatelliteBlock
from obseq.images.satellite.output import corrected_rpc


@pytest.mark.parametrize("ending", ["_RPC.TXT", ".rpb", ".xml"])
def test_coefficients_survive_each_form(tmp_path, ending):
    rpc = satellites.made_rpc()
    path = tmp_path / f"view.1{ending}"
    path.write_text(rpc_text(rpc, path))
    again = read_rpc(path)
    assert again.offsets == rpc.offsets
    assert again.scales == rpc.scales
    np.testing.assert_array_equal(again.coefficients, rpc.coefficients)
    assert image_of(path) == "view.1"


def test_dimap_counts_from_one_and_its_inverse_model_leads_to_the_image(tmp_path):
    rpc = satellites.made_rpc()
    direct = "".join(
        f"<{p}_COEFF_{k}>9</{p}_COEFF_{k}>" for p in ("SAMP_NUM", "LINE_DEN") for k in range(1, 21)
    )
    inverse = "".join(
        f"<{part}_COEFF_{k + 1}>{value!r}</{part}_COEFF_{k + 1}>"
        for part, row in zip(
            ("LINE_NUM", "LINE_DEN", "SAMP_NUM", "SAMP_DEN"), rpc.coefficients.tolist(), strict=True
        )
        for k, value in enumerate(row)
    )
    fields = "".join(f"<{key}_SCALE>{value!r}</{key}_SCALE>" for key, value in rpc.scales.items())
    for key, value in rpc.offsets.items():
        fields += f"<{key}_OFF>{value + (key in ('LINE', 'SAMP'))!r}</{key}_OFF>"
    (tmp_path / "a.xml").write_text(
        "<Dimap_Document><Rational_Function_Model><Global_RFM>"
        f"<Inverse_Model>{inverse}</Inverse_Model><Direct_Model>{direct}</Direct_Model>"
        f"<RFM_Validity>{fields}</RFM_Validity></Global_RFM></Rational_Function_Model></Dimap_Document>"
    )
    again = read_rpc(tmp_path / "a.xml")
    assert again.offsets == rpc.offsets
    np.testing.assert_array_equal(again.coefficients, rpc.coefficients)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("LAT_OFF", "LAT_AWAY"), "LAT_OFF is missing"),
        (("LINE_NUM_COEFF_7:", "LINE_NUM_COEFF_77:"), "LINE_NUM_COEFF_7 is missing"),
        (("LAT_SCALE: 0.063", "LAT_SCALE: 0.0"), "LAT_SCALE is zero"),
    ],
)
def test_what_a_file_lacks_is_named(tmp_path, change, message):
    text = satellites.made_rpc().text()
    assert change[0] in text
    (tmp_path / "a_RPC.TXT").write_text(text.replace(*change))
    with pytest.raises(InputError, match=message):
        read_rpc(tmp_path / "a_RPC.TXT")


@pytest.mark.parametrize("correction", ["bias", "affine"])
def test_corrections_and_points_come_back_within_their_sigmas(correction):
    made = satellites.scene(correction=correction)
    solution = made.block.solve()
    assert solution.result.converged
    assert 0.85 < solution.result.sigma0 < 1.15
    for image, (values, sigmas) in solution.corrections().items():
        assert (np.abs(values - made.corrections[image]) < 4.0 * sigmas).all()
    names, differences, covariances = solution.check()
    sigmas = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    assert len(names) == 20
    assert (np.abs(differences) <= 1.96 * sigmas).mean() > 0.85
    assert sigmas.max() < 1.5
    off = made.block.project(np.zeros(60, dtype=int), made.points)
    fitted = corrected_rpc(solution, "fore")
    ground = np.asarray(
        crs.Transformer(crs.parse(made.block.frame), crs.parse(GEOGRAPHIC)).forward(made.points)
    )
    middle = [made.block.rpcs["fore"].offsets[key] for key in ("SAMP", "LINE")]
    dx, dy, *more = solution.corrections()["fore"][0]
    wanted = off + np.array([dx, dy])
    if more:
        (x01, y01, x10, y10) = more
        wanted = wanted + np.column_stack([off @ [x10, x01], off @ [y10, y01]])
    np.testing.assert_allclose(fitted.project(ground), wanted + middle, atol=0.05)


def test_without_correction_the_residuals_show_it():
    made = satellites.scene(correction="bias")
    block = made.block
    stiff = SatelliteBlock(
        block.rpcs, block.measures, block.control, block.check_points, block.frame, "bias", 1e-3
    )
    assert stiff.solve().result.sigma0 > 3.0


def test_a_held_control_point_stays():
    made = satellites.scene(correction="bias")
    made.block.control = ControlPoints.of(made.block.control.names, made.block.control.coordinates, 0.0)
    solution = made.block.solve()
    rows = [solution.points.index(name) for name in made.block.control.names]
    np.testing.assert_array_equal(solution.coordinates[rows], made.block.control.coordinates)
    assert (solution.covariances[rows] == 0.0).all()


def test_the_command(tmp_path, capsys):
    made = satellites.scene(correction="affine")
    block, paths = made.block, []
    for image, rpc in block.rpcs.items():
        paths.append(tmp_path / f"{image}_RPC.TXT")
        paths[-1].write_text(rpc.text())
    measures = block.measures
    rows = [
        f"{measures.image_names[i]}.tif,{measures.point_names[p]},{x!r},{y!r}"
        for i, p, (x, y) in zip(measures.image, measures.point, measures.xy.tolist(), strict=True)
    ]
    rows.append("fore.tif,alone,5.0,6.0")
    (tmp_path / "m.csv").write_text("\n".join(["image,point,x,y", *rows]) + "\n")
    to_map = crs.Transformer(crs.parse(block.frame), crs.parse("EPSG:2154")).forward
    for name, control in (("gcp", block.control), ("check", block.check_points)):
        places = np.asarray(to_map(control.coordinates)).tolist()
        lines = [f"{point},{x!r},{y!r},{z!r}" for point, (x, y, z) in zip(control.names, places, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["point,x,y,z", *lines]) + "\n")
    given = ["satellite", "--rpc", *map(str, paths), f"--measures={tmp_path / 'm.csv'}", "--image-sigma=0.4"]
    given += [
        f"--control={tmp_path / 'gcp.csv'}",
        f"--check-points={tmp_path / 'check.csv'}",
        "--control-sigma=0.2",
    ]
    given += ["--control-crs=EPSG:2154", "--correction=affine", f"--out={tmp_path / 'out'}"]
    given += [f"--rpc-out={tmp_path / 'rpc'}", "--rpc-form=rpb"]
    assert main(given) == 1  # a point with one ray
    shown = capsys.readouterr().out
    assert "left out, one ray each: alone" in shown
    assert "6 of them control points" in shown
    assert "of 60 within 1.96 sigmas" in shown
    assert "above the ellipsoid" in shown
    assert (tmp_path / "out" / "points.csv").read_text().count("\n") == 61
    corrected = read_rpc(tmp_path / "rpc" / "fore.rpb")
    assert corrected.offsets != block.rpcs["fore"].offsets
