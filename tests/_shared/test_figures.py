"""Files of figures: the same bytes for the same picture, fonts inside, a quick run marked."""

from __future__ import annotations

from gaia_uwb._shared.figures import figure_files, house_style, legend_above, look, new_figure
from gaia_uwb.reproduce.plan import METHODS


def draw():
    with house_style():
        figure = new_figure(2.0)
        figure.subplots().plot([0.0, 1.0], label="straight")
    return figure


def test_files_are_reproducible_with_embedded_fonts() -> None:
    first, second = figure_files(draw()), figure_files(draw())
    assert first == second
    assert first["pdf"].startswith(b"%PDF")
    assert b"/FontFile2" in first["pdf"]  # a TrueType font, not shapes of letters
    assert first["png"].startswith(b"\x89PNG")


def test_a_note_is_drawn() -> None:
    figure = draw()
    figure_files(figure, note="QUICK RUN")
    assert figure.get_supxlabel() == "QUICK RUN"


def test_methods_can_be_told_apart() -> None:
    looks = [look(method.name) for method in METHODS]
    assert len({each.colour for each in looks}) == len(looks)
    assert len({each.mark for each in looks}) == len(looks)
    assert look("somebody's").label == "somebody's"


def test_a_legend_of_all_methods_stays_on_the_page() -> None:
    with house_style():
        figure = new_figure(2.5)
        axes = figure.subplots()
        for method in METHODS:
            axes.plot([0.0, 1.0], label=look(method.name).label)
        legend_above(figure, axes)
        figure.draw_without_rendering()
    box, page = figure.legends[0].get_window_extent(), figure.bbox
    assert page.x0 <= box.x0 and box.x1 <= page.x1
    assert page.y0 <= box.y0 and box.y1 <= page.y1
    assert box.y0 >= axes.get_window_extent().y1  # above, not on top of what is drawn


def test_settings_of_the_user_do_not_count() -> None:
    from matplotlib import rc_context

    before = figure_files(draw())
    with rc_context(
        {"text.usetex": True, "font.size": 40, "savefig.bbox": "tight", "axes.facecolor": "red"}
    ):
        assert figure_files(draw()) == before
