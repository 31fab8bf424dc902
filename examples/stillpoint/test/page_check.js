// SPDX-License-Identifier: BSD-2-Clause
// Put at the end of a page of `bench` by page_test.cpp: uses the page as a reader does, and writes
// what it found into the document for `chromium --dump-dom`. window.problems is filled from the
// page's first line on.
(async () => {
  const problems = window.problems;
  const expect = (good, what) => { if (!good) problems.push(what); };
  const pause = () => new Promise((resolve) => setTimeout(resolve, 100));
  const all = (selector) => [...document.querySelectorAll(selector)];

  all('details').forEach((d) => { d.open = true; });
  await pause();
  await pause();

  // Each column of each table: ascending, descending, as it was; what is no number stands last.
  const order = (body) => [...body.rows].map((row) => row.textContent).join('\n');
  for (const table of all('table.sortable')) {
    const body = table.tBodies[0], before = order(body);
    [...table.querySelectorAll('th')].forEach((head, column) => {
      for (const sign of [1, -1]) {
        head.click();
        const texts = [...body.rows].map((row) => row.cells[column].textContent);
        const values = texts.map(parseFloat);
        for (let i = 1; i < texts.length; ++i)
          expect(column === 0 ? sign * texts[i - 1].localeCompare(texts[i]) <= 0
            : Number.isNaN(values[i]) || sign * (values[i] - values[i - 1]) >= 0,
            `not sorted by ${head.textContent}: ${texts}`);
      }
      head.click();
      expect(order(body) === before, `rows are not as they were after ${head.textContent}`);
    });
  }

  // Every chart has pixels of one of its curves inside its axes, and of each in the legend.
  const rgb = (color) => [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16));
  const hasColor = (pixels, color) => {
    const wanted = rgb(color);
    for (let i = 0; i < pixels.length; i += 4)
      if (pixels[i + 3] > 200 && wanted.every((c, k) => Math.abs(pixels[i + k] - c) < 30)) return true;
    return false;
  };
  const at = (chart, type, x, y, kind = MouseEvent) => {
    const box = chart.canvas.getBoundingClientRect();
    chart.canvas.dispatchEvent(new kind(type, {
      bubbles: true, button: 0, pointerType: 'mouse', clientX: box.left + x, clientY: box.top + y,
    }));
  };
  const charts = window.Chart ? all('figure.chart canvas').map((canvas) => Chart.getChart(canvas)) : [];
  for (const chart of charts) {
    const name = chart && chart.$described.title;
    expect(chart, 'a canvas without a chart');
    if (!chart) continue;
    const area = chart.chartArea, ratio = chart.currentDevicePixelRatio;
    expect(area.right - area.left > 100 && area.bottom - area.top > 30, `${name}: no room for the curves`);
    const pixels = chart.ctx.getImageData(area.left * ratio, area.top * ratio, (area.right - area.left) * ratio,
      (area.bottom - area.top) * ratio).data;
    expect(chart.data.datasets.some((d) => hasColor(pixels, d.borderColor ?? d.backgroundColor)), `${name}: no curve is drawn`);
    if (chart.$described.equal) {
      const unit = (scale, length) => (scale.max - scale.min) / length;
      const x = unit(chart.scales.x, area.right - area.left), y = unit(chart.scales.y, area.bottom - area.top);
      expect(Math.abs(x / y - 1) < 0.02, `${name}: units of ${x} and ${y} m per pixel`);
    }

    // A click on a name in the legend hides the curve, the next one shows it.
    if (chart.legend.options.display) {
      const hit = chart.legend.legendHitBoxes[0];
      for (const shown of [false, true]) {
        at(chart, 'click', hit.left + 4, hit.top + 4);
        await pause();
        expect(chart.isDatasetVisible(0) === shown, `${name}: the legend does not switch`);
      }
    }

    // Hover says values.
    if (chart.$described.kind === 'bars') continue;
    const middle = { x: (area.left + area.right) / 2, y: (area.top + area.bottom) / 2 };
    at(chart, 'mousemove', middle.x, middle.y);
    await pause();
    expect(chart.tooltip.opacity > 0 && chart.tooltip.body.length > 0, `${name}: hover says nothing`);

    // Drag zooms, with all charts of the group; a double click shows all again.
    const group = charts.filter((c) => c === chart || (chart.$described.group && c.$described.group === chart.$described.group
      && c.$described.x === chart.$described.x));
    const spans = () => group.map((c) => c.scales.x.max - c.scales.x.min);
    const before = spans();
    at(chart, 'pointerdown', middle.x - 30, middle.y - 20, PointerEvent);
    at(chart, 'pointermove', middle.x + 30, middle.y + 20, PointerEvent);
    at(chart, 'pointerup', middle.x + 30, middle.y + 20, PointerEvent);
    spans().forEach((span, i) => expect(span < 0.6 * before[i], `${name}: drag does not zoom ${group[i].$described.title}`));
    at(chart, 'dblclick', middle.x, middle.y);
    spans().forEach((span, i) => expect(Math.abs(span / before[i] - 1) < 0.02, `${name}: a double click does not show all`));
  }
  expect(document.documentElement.scrollWidth <= window.innerWidth, 'the page is wider than the window');

  const report = document.createElement('pre');
  report.id = 'checked';
  report.textContent = `charts ${charts.length}, tables ${all('table.sortable').length}, problems ${problems.length}\n${problems.join('\n')}`;
  document.body.append(report);
})();
