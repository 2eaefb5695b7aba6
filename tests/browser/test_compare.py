"""The page of a comparison in a browser: a point opens its flight's report."""

from rebound_cli.compare.page import CHARTS, write_page
from rebound_cli.compare.rows import Row


def test_each_chart_has_its_points_and_a_point_opens_its_flights_report(opened, tmp_path):
    # Given two laws, two flights each
    rows = [
        Row(law, law, 2.0, seed, f"{law}-{seed}/report.html", "completed", "", 0, 2.0, rest_s + seed, 0.1, 0.5)
        for law, rest_s in (("paper", 5.0), ("adaptive", 1.0))
        for seed in (1, 2)
    ]
    for row in rows:
        (tmp_path / row.report).parent.mkdir()
        (tmp_path / row.report).write_text(f"<title>{row.report}</title>")
    write_page(tmp_path / "compare.html", "wall & <racer>", rows)

    with opened((tmp_path / "compare.html").as_uri()) as shown:
        assert shown.text("h1") == "wall & <racer>" and shown.complaints == []
        assert shown.page.locator("svg a").count() == len(rows) * len(CHARTS)
        assert shown.page.locator("table tr").count() == 3
        with shown.page.expect_popup() as report:
            shown.page.locator('svg a[*|href="adaptive-2/report.html"]').first.click()
        assert report.value.title() == "adaptive-2/report.html"
