"""Terms of cameras that formats of other programs lack: refused before an adjustment that makes them."""

from __future__ import annotations

from collections.abc import Collection

from obseq.errors import InputError
from obseq.images.block import Block
from obseq.images.camera import Camera


def check_camera(camera: Camera, form: str, terms: Collection[str], unknown: Collection[str] = ()) -> None:
    """Refuses a camera that a format cannot hold.

    Args:
        camera: as it is.
        form: name of the format.
        terms: of the distortion that it has.
        unknown: terms that an adjustment to come gives their values.

    Raises:
        InputError: it is no pinhole with a distortion of degrees; or it has other terms, which are told with
            what holds them at zero.
    """
    if not camera.is_mmvii or camera.projection != "Stenope":
        kind = camera.projection if camera.is_mmvii else f"the distortion of {camera.formula}"
        raise InputError(
            f"camera {camera.name}: {form} has no place for {kind}: it holds pinholes with the terms "
            f"{', '.join(terms)}; write the tables of this program (--out, --interior, --poses)"
        )
    given = dict(zip(camera.coefficient_names, camera.coefficients.tolist(), strict=True))
    others = [name for name, value in given.items() if name not in terms and (value or name in unknown)]
    if others:
        state = "not zero" if any(given[name] for name in others) else "unknown"
        raise InputError(
            f"camera {camera.name}: {form} has no place for {', '.join(others)} of a camera, {state} here: "
            "give 0 in the table of cameras (or no such column) and hold that by "
            f"--freeze '{'|'.join(others)}' (freeze_parameters), or write the tables of this program (--out, "
            "--interior, --poses)"
        )


def check_cameras(block: Block, form: str, terms: Collection[str], known: Collection[str] = ()) -> None:
    """Refuses, before its adjustment, a block whose cameras a format cannot hold (see `check_camera`).

    Args:
        block: to be written.
        form: name of the format.
        terms: of the distortion that it has.
        known: cameras that came from it.
    """
    for name in dict.fromkeys(block.camera_of.values()):
        if name in known:
            continue
        camera = block.cameras[name]
        unknown = [term for term in camera.coefficient_names if not block.is_frozen(name, term)]
        check_camera(camera, form, terms, unknown)
