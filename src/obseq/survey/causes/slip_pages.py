"""What a person can read of slips of the pen and of the field: a page for each code."""

from obseq.diagnosis.page import Page

_OF_UNIT = "Give the value in the unit of the file, or say the unit."
_OF_DIGIT = "Look up the value in the field notes."
_OF_CONVENTION = "Convert the value, or say how it is counted."
_OF_HEIGHT = "Look up the height in the field notes."


def _turned(what: str) -> tuple[str, ...]:
    """What is tested of a value that is turned into another one."""
    return (f"{what} must be what the rest gives, and rarely so by chance.",)


def _unit(code: str, given: str, read: str, factor: str) -> Page:
    name = f"{given} read as {read}"
    about = f"A value in {given} stands where {read} are expected."
    example = f"A list in {given} among files in {read}."
    return Page(code, name, about, _turned(f"The value times {factor}"), example, _OF_UNIT)


SLIPS = (
    _unit("W100", "degrees", "gon", "10/9"),
    _unit("W101", "gon", "degrees", "9/10"),
    Page(
        "W102",
        "other face",
        "A circle was read in the other face of the telescope.",
        _turned("The direction plus half a turn, or a turn less the zenith angle,"),
        "One reading in face II among those of face I.",
        "Convert the reading to the first face.",
    ),
    Page(
        "W103",
        "elevation",
        "An elevation stands in place of a zenith angle.",
        _turned("The quarter of a turn less, or plus, the value"),
        "The instrument was set to vertical angles from the horizon.",
        _OF_CONVENTION,
    ),
    Page(
        "W104",
        "from the nadir",
        "A vertical angle is counted from the nadir.",
        _turned("Half a turn less the value"),
        "An instrument that counts from below.",
        _OF_CONVENTION,
    ),
    Page(
        "W105",
        "sign",
        "A value has the wrong sign.",
        _turned("The value with the other sign"),
        "The two points of a height difference were exchanged; a minus was lost.",
        "Change the sign, or the order of the points.",
    ),
    _unit("W106", "feet", "metres", "0.3048"),
    _unit("W107", "metres", "feet", "1/0.3048"),
    Page(
        "W108",
        "horizontal distance",
        "A horizontal distance stands in place of a slope distance.",
        _turned("The horizontal part of the sight, as it is without the error,"),
        "The instrument was set to reduced distances.",
        "Give the code of horizontal distances, or the slope distance.",
    ),
    Page(
        "W109",
        "wrong digit",
        "One digit of a value is wrong.",
        _turned("The value with one other digit"),
        "123.957 typed for 123.457.",
        _OF_DIGIT,
    ),
    Page(
        "W110",
        "exchanged digits",
        "Two digits of a value that stand side by side are exchanged.",
        _turned("The value with these two in the other order"),
        "312.457 typed for 321.457.",
        _OF_DIGIT,
    ),
    Page(
        "W111",
        "degrees, minutes and seconds",
        "A value in degrees, minutes and seconds (ddd.mmss) stands where gon are expected.",
        _turned("The value so read"),
        "45.3020 for 45 degrees, 30 minutes and 20 seconds.",
        _OF_UNIT,
    ),
    Page(
        "W112",
        "another point",
        "A reading, or an image point, is that of another point.",
        _turned("What another point would have"),
        "The pole next to it was sighted.",
        "Correct the name of the point.",
    ),
    Page(
        "W113",
        "exchanged readings",
        "Two readings, or two image points, are exchanged.",
        ("Each must be what the rest gives for the other.",),
        "Two lines of a field book were entered in the wrong order.",
        "Exchange the values.",
    ),
    Page(
        "W114",
        "height left out",
        "A height of instrument or target was not entered.",
        ("The height that fits must be like those of other lines.",),
        "A column of heights that was left empty.",
        _OF_HEIGHT,
    ),
    Page(
        "W115",
        "sign of a height",
        "A height of instrument or target has the wrong sign, or does not belong there.",
        ("The height that fits must be its opposite, or nothing.",),
        "A target that hangs from a roof.",
        _OF_HEIGHT,
    ),
    Page(
        "W116",
        "height of another line",
        "A height of instrument or target is that of another line.",
        ("The height that fits must be one of the file, and rarely so by chance.",),
        "The pole was lengthened, and the height was noted one line too late.",
        _OF_HEIGHT,
    ),
    Page(
        "W117",
        "face changed",
        "From one reading of a set-up on the other face was read.",
        ("The circle must be turned by half a turn.",),
        "The telescope was turned over in the middle of a round.",
        "Convert the readings to the first face, or make them a set-up of their own.",
    ),
    Page(
        "W118",
        "target's name",
        "All that was read to a target fits another point.",
        ("Each reading of the sight must fit that point.",),
        "A name was mistyped, or another point was sighted.",
        "Correct the name of the target.",
    ),
    Page(
        "W119",
        "stand point's name",
        "All that was read in a set-up fits another stand point.",
        ("The set-up must fit on that point.",),
        "A name was mistyped, or the instrument stood on another point.",
        "Correct the name of the stand point.",
    ),
    Page(
        "W120",
        "constant of a prism",
        "Distances were read with the constant of another prism.",
        ("The error must be what constants of prisms differ by, and rarely so by chance.",),
        "A 360 degree prism with the constant of a round one.",
        "Correct the distances by the constant.",
    ),
    Page(
        "W123",
        "exchanged coordinates",
        "Easting and northing, or x and y, of a point are exchanged.",
        ("The point must fit with its coordinates in the other order.",),
        "A list in the order northing, easting.",
        "Exchange the coordinates, or say their order.",
    ),
    _unit("W125", "radians", "gon", "200/pi"),
    _unit("W126", "millimetres", "metres", "1/1000"),
    _unit("W127", "centimetres", "metres", "1/100"),
    _unit("W128", "kilometres", "metres", "1000"),
    Page(
        "W129",
        "decimal point",
        "The decimal point of a value is in the wrong place.",
        _turned("The value times or over 10 or 100"),
        "1002.5 typed for 100.25.",
        _OF_DIGIT,
    ),
    Page(
        "W130",
        "missing digit",
        "The leading digit of a value is missing.",
        _turned("The value with one more digit"),
        "23.457 typed for 123.457.",
        _OF_DIGIT,
    ),
    Page(
        "W131",
        "anticlockwise",
        "A direction or an angle is counted in the other sense.",
        _turned("The value with the other sign"),
        "The circle was set to count to the left; first and last point of an angle were exchanged.",
        _OF_CONVENTION,
    ),
    Page(
        "W132",
        "elevation in degrees",
        "An elevation in degrees stands in place of a zenith angle in gon.",
        _turned("The quarter of a turn less the value times 10/9"),
        "A clinometer in degrees beside an instrument in gon.",
        _OF_CONVENTION,
    ),
    Page(
        "W133",
        "coordinates of another point",
        "A point has the coordinates of another one.",
        ("The point must fit where the other one is given, or is.",),
        "Two names were exchanged in a list of coordinates.",
        "Correct the names.",
    ),
    Page(
        "W134",
        "exchanged ends",
        "A vector goes from its second point to its first.",
        ("The vector must fit with the other sign.",),
        "From and to were exchanged in a list of baselines.",
        "Exchange the two points.",
    ),
)
"""All slips of surveys; those of blocks that are the same have the same code."""
