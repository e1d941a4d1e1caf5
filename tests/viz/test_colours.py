from s2c2a.viz.colors import colors_by_label, module_colors


def test_three_modules_are_blue_green_red_and_any_number_gets_as_many_colors():
    assert module_colors(3) == ["#2f6fdb", "#34a853", "#e0463a"]
    assert module_colors(1) == ["#2f6fdb"]
    for count in (2, 5, 20):
        colors = module_colors(count)
        assert len(set(colors)) == count
        assert (colors[0], colors[-1]) == ("#2f6fdb", "#e0463a")


def test_a_controller_keeps_its_color_whatever_it_is_drawn_with():
    assert colors_by_label(["pcc", "s2c2a"]) == colors_by_label(["s2c2a", "pcc"])
    assert colors_by_label(["mine", "pcc"])["pcc"] == colors_by_label(["pcc"])["pcc"]


def test_unknown_controllers_get_colors_of_their_own():
    colors = colors_by_label(["mine", "s2c2a", "yours", "pcc"])
    assert len(set(colors.values())) == 4


def test_a_label_that_comes_again_keeps_its_color():
    assert colors_by_label(["mine", "pcc", "mine"]) == colors_by_label(["mine", "pcc"])
