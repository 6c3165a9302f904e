"""DynaML files, record by record: stations that are given again, records in any order, a broken end."""

import pytest

from obseq.errors import InputError
from obseq.survey import Network

STATION = """<DnaStation><Name>{name}</Name><Constraints>{held}</Constraints><Type>LLh</Type>
<StationCoord><Name>{name}</Name><XAxis>-35.{minutes}</XAxis><YAxis>149.0</YAxis><Height>{height}</Height>
</StationCoord></DnaStation>
"""
DISTANCE = """<DnaMeasurement><Type>S</Type><First>A</First><Second>B</Second><Value>1850.3</Value>
<StdDev>0.01</StdDev></DnaMeasurement>
"""
HEAD = '<DnaXmlFormat type="Combined File" referenceframe="GDA2020" epoch="">\n'
END = "</DnaXmlFormat>\n"


def station(name, minutes, height=10.0, held="FFF"):
    return STATION.format(name=name, minutes=minutes, height=height, held=held)


def network(tmp_path, *parts):
    path = tmp_path / "n.xml"
    path.write_text(HEAD + "".join(parts))
    return Network.read_project(path)


def test_a_free_station_may_be_given_again(tmp_path):
    """DynAdjust strips what is given again; coordinates that are held could contradict each other."""
    first = (station("A", "00"), station("B", "01"))
    whole = network(tmp_path, *first, DISTANCE, END)
    twice = network(tmp_path, *first, station("A", "00", 11.0), DISTANCE, END)
    assert twice.points.coordinates.tolist() == whole.points.coordinates.tolist()
    assert any("given again: their first coordinates count: A (" in text for text in twice.book.warnings)
    with pytest.raises(InputError, match=r"n\.xml:8: station A is given twice \(first at .*n\.xml:2\)"):
        network(tmp_path, *first, station("A", "00", held="CCC"), DISTANCE, END)


def test_measurements_may_stand_before_stations(tmp_path):
    book = network(tmp_path, DISTANCE, station("A", "00", held="CCC"), station("B", "01"), END).book
    assert book.observations.values.tolist() == [1850.3]
    assert book.observations.lines.tolist() == [2]


def test_a_broken_end_is_told_though_records_came_before(tmp_path):
    with pytest.raises(InputError, match=r"n\.xml:9: the XML is broken"):
        network(tmp_path, station("A", "00"), station("B", "01"), DISTANCE)
