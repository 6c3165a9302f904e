from obseq.report.listing import listing


def test_every_point_station_and_observation_is_listed(record) -> None:
    lines = listing(record).splitlines()
    for name in "ABC":
        assert sum(line.startswith(f"  {name} ") for line in lines) == 2 + (name == "A")
    assert [line.split()[3] for line in lines if line.startswith(("  Hz", "  Dist"))] == [
        "site.obs:1",
        "site.obs:2",
        "site.obs:3",
        "site.obs:4",
    ]


def test_an_observation_that_is_not_used_is_marked(record) -> None:
    assert any("site.obs:4" in line and "not used" in line for line in listing(record).splitlines())


def test_the_zero_of_the_circle_is_in_gon(record) -> None:
    assert "350.00000" in listing(record)


def test_iterations_are_numbered_from_one(record) -> None:
    lines = [line.split() for line in listing(record).splitlines()]
    assert ["1", "120.5", "2.5"] in lines
    assert ["2", "1.25", "0.001"] in lines


def test_all_warnings_are_listed(make) -> None:
    assert listing(make(warnings=[f"w{k}" for k in range(50)])).count("Warning: w") == 50


def test_long_names_of_files_do_not_make_it_wide(plain, make) -> None:
    plain["observations"][0]["file"] = "measured-on-the-first-of-all-the-days-of-may.obs"
    text = listing(make())
    assert "measure...ay.obs:1 " in text
    assert max(map(len, text.splitlines())) <= 120
    plain["observations"][1]["file"] = "measured-on-the-first-of-two-more-days-of-may.obs"
    assert "of-two-more-days-of-may.obs:2" in listing(make())  # ambiguous when short
