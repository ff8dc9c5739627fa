"""Charts over time that a browser draws: for the pages of reports, and for a live page.

Map
---
plotdata.py  What a chart is made of: frozen data.
palette.py   Colours for light and dark paper; one colour a contender.
units.py     Units and powers of ten in labels.
thinning.py  Fewer points that show the same line.
block.py     A chart as a JSON block, the only thing that scripts read.
assets.py    The scripts and styles, as text to put into a page.
assets/      chart.js and chart.css (ours), uplot/ (Leon Sorokin's, MIT licence, from the npm registry).

A page holds the styles, the scripts, and for each chart ::

    <div class="chart"><script type="application/json">BLOCK</script></div>

`AdaptiveFlotChart.start()` then draws each one as it comes into view. A page that gets data as they come calls
`AdaptiveFlotChart.make(element, block)`, and `chart.append(panel, times, rows)` or `chart.renew(range, tables)`.

The block has the keys `x` (label, unit, `time`: linked with the other charts of the page, `clock`: seconds since 1970
that are shown as time of day), `panels` and `marks`.
A panel is of the kind `lines` (`label`, `unit`, `height`, `limits`, `range`, `band`, `x`: tables of times, `series`)
or `strips` (`rows`, `states`). Numbers are `{"o": first, "s": step, "v": [0, 3, null, ...]}`: first + step times
each, null is a gap; with `n` in place of `v` they count 0 to n - 1.
"""
