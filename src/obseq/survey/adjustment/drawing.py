"""What a notebook or a terminal shows of a network before it is adjusted."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.survey.adjustment.adjusted_records import place_records

if TYPE_CHECKING:
    from obseq.survey.adjustment.frame import Frame
    from obseq.survey.model import FieldBook, Points


def network_html(points: Points, book: FieldBook, frame: Frame) -> str:
    """What a network consists of, and a plan of the points that have coordinates."""
    from obseq.report import notebook

    names, observations = book.point_names, book.observations
    ends = zip(observations.from_points.tolist(), observations.to_points.tolist(), strict=True)
    return notebook.network_html(
        place_records(points),
        ((names[a], names[b]) for a, b in ends),
        {names[row] for row in book.stations.origins.tolist()},
        network_text(points, book, frame),
    )


def network_text(points: Points, book: FieldBook, frame: Frame) -> str:
    """What a network consists of, in a line."""
    known = int((~points.is_free).any(axis=1).sum())
    return (
        f"{len(points)} points ({known} known), {len(book.observations)} observations, "
        f"{len(book.stations)} stations; frame {frame.system.definition}"
    )
