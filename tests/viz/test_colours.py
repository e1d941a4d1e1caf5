from s2c2a.viz.colours import colours_by_label, module_colours


def test_three_modules_are_blue_green_red_and_any_number_gets_as_many_colours():
    assert module_colours(3) == ["#2f6fdb", "#34a853", "#e0463a"]
    assert module_colours(1) == ["#2f6fdb"]
    for count in (2, 5, 20):
        colours = module_colours(count)
        assert len(set(colours)) == count
        assert (colours[0], colours[-1]) == ("#2f6fdb", "#e0463a")


def test_a_controller_keeps_its_colour_whatever_it_is_drawn_with():
    assert colours_by_label(["pcc", "s2c2a"]) == colours_by_label(["s2c2a", "pcc"])
    assert colours_by_label(["mine", "pcc"])["pcc"] == colours_by_label(["pcc"])["pcc"]


def test_unknown_controllers_get_colours_of_their_own():
    colours = colours_by_label(["mine", "s2c2a", "yours", "pcc"])
    assert len(set(colours.values())) == 4


def test_a_label_that_comes_again_keeps_its_colour():
    assert colours_by_label(["mine", "pcc", "mine"]) == colours_by_label(
        ["mine", "pcc"]
    )
