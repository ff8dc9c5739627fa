"""The pictures of one page: numbered as they are shown, and the data of those that move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from adaptive_flot.charts.block import blocks
from adaptive_flot.charts.plotdata import Chart
from adaptive_flot.greybox.stepping.rows import worker_threads
from adaptive_flot.parallel import parallel_map
from adaptive_flot.report.kit.parts import Picture

if TYPE_CHECKING:  # what prints tables has no need of Matplotlib, which takes a while to load
    from matplotlib.figure import Figure

    from adaptive_flot.report.kit.heat import HeatMap


@dataclass
class Album:
    """The pictures of one page. The template numbers them in the order in which it shows them."""

    pictures: list[Picture] = field(default_factory=list)
    shown: list[Picture] = field(default_factory=list)

    def add(self, figure: Figure, caption: str, alt: str) -> Picture:
        """Embed a figure."""
        from adaptive_flot.report.kit.style import data_uri

        return self._kept(Picture(caption, alt, data_uri(figure)))

    def heat(self, heat: HeatMap, caption: str, alt: str) -> Picture:
        """Embed a map."""
        return self._kept(Picture(caption, alt, heat=heat))

    def chart(self, chart: Chart, caption: str, alt: str) -> Picture:
        """Embed a chart, and a picture of it for readers without scripts."""
        return self._kept(Picture(caption, alt, chart=chart))

    def number(self, picture: Picture) -> int:
        """Return the number of a picture: the next one where it has none."""
        if picture not in self.shown:
            self.shown.append(picture)
        return self.shown.index(picture) + 1

    def blocks(self) -> dict[int, str]:
        """JSON of each chart by the place of its picture."""
        return self._of_charts(blocks)

    def stills(self) -> dict[int, str]:
        """Picture of each chart, as a data URI, by its place: for readers without scripts. On all cores."""
        from adaptive_flot.report.kit.figures import chart_figure
        from adaptive_flot.report.kit.style import data_uri

        def still(chart: Chart) -> str:
            return data_uri(chart_figure(chart), small=True)

        return self._of_charts(lambda charts: parallel_map(still, charts, worker_threads()))

    def _of_charts(self, make: Callable[[list[Chart]], list[str]]) -> dict[int, str]:
        charts = {i: p.chart for i, p in enumerate(self.pictures) if p.chart is not None}
        return dict(zip(charts, make(list(charts.values())), strict=True))

    def _kept(self, picture: Picture) -> Picture:
        self.pictures.append(picture)
        return picture
