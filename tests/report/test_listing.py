from obseq.report.adjusted import outcome
from obseq.report.summary import listing


def test_every_point_station_and_observation_is_listed(record) -> None:
    lines = listing(outcome(record)).splitlines()
    lines = lines[next(k for k, line in enumerate(lines) if line.startswith("Observations.")) :]
    for name in "ABC":
        assert sum(line.startswith(f"  {name} ") for line in lines) == 2 + (name == "A")
    assert [line.split()[3] for line in lines if line.startswith(("  Hz", "  Dist"))] == [
        "site.obs:1",
        "site.obs:2",
        "site.obs:3",
        "site.obs:4",
    ]


def test_an_observation_that_is_not_used_is_marked(record) -> None:
    assert any("site.obs:4" in line and "not used" in line for line in listing(outcome(record)).splitlines())


def test_the_zero_of_the_circle_is_in_gon(record) -> None:
    assert "350.00000" in listing(outcome(record))


def test_iterations_are_numbered_from_one(record) -> None:
    text = listing(outcome(record))
    assert "iteration 1: sigma0 120.5 at its start, largest step 2.5" in text
    assert "iteration 2: sigma0 1.25 at its start, largest step 0.001" in text


def test_all_warnings_are_listed(make) -> None:
    assert listing(outcome(make(warnings=[f"w{k}" for k in range(50)]))).count("Warning: w") == 50


def test_long_names_of_files_do_not_make_it_wide(plain, make) -> None:
    plain["observations"][0]["file"] = "measured-on-the-first-of-all-the-days-of-may.obs"
    text = listing(outcome(make()))
    assert "measure...ay.obs:1 " in text
    assert max(map(len, text.splitlines())) <= 120
    plain["observations"][1]["file"] = "measured-on-the-first-of-two-more-days-of-may.obs"
    assert "of-two-more-days-of-may.obs:2" in listing(outcome(make()))  # ambiguous when short
