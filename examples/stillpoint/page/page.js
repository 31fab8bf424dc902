'use strict';
// Tables are sorted by a click on a column's head; charts are Chart.js, with zoom by dragging.
(() => {
  const all = (selector, parent = document) => [...parent.querySelectorAll(selector)];

  // "0.0016 !" is a number, "-" and "failed: 33 %" are none and stay last.
  const number = (cell) => {
    const value = parseFloat(cell.textContent);
    return Number.isNaN(value) ? null : value;
  };
  const compare = (a, b, column, sign) => {
    const x = number(a.cells[column]), y = number(b.cells[column]);
    if (column === 0) return sign * a.cells[0].textContent.localeCompare(b.cells[0].textContent);
    if (x === null || y === null) return (x === null) - (y === null);
    return sign * (x - y);
  };
  for (const table of all('table.sortable')) {
    const body = table.tBodies[0], given = [...body.rows], heads = all('th', table);
    heads.forEach((head, column) => {
      head.tabIndex = 0;
      const sort = () => {
        // Ascending, descending, as it was.
        const next = { ascending: 'descending', descending: '' }[head.getAttribute('aria-sort')] ?? 'ascending';
        heads.forEach((h) => h.removeAttribute('aria-sort'));
        if (next) head.setAttribute('aria-sort', next);
        const rows = [...given];
        if (next) rows.sort((a, b) => compare(a, b, column, next === 'ascending' ? 1 : -1));
        body.append(...rows);
      };
      head.addEventListener('click', sort);
      head.addEventListener('keydown', (event) => { if (event.key === 'Enter') sort(); });
    });
  }

  if (!window.Chart) {
    all('figure.chart').forEach((figure) => figure.remove());
    return;
  }
  const described = JSON.parse(document.getElementById('charts').textContent);
  const theme = () => {
    const style = getComputedStyle(document.documentElement);
    const of = (name) => style.getPropertyValue('--' + name).trim();
    return { ink: of('ink'), muted: of('muted'), line: of('line'), card: of('card') };
  };
  let colors = theme();
  const paint = (name) => colors[name] ?? name;
  Chart.defaults.animation = false;
  Chart.defaults.maintainAspectRatio = false;
  Chart.defaults.font.family = getComputedStyle(document.body).fontFamily;

  const short = (value) => Math.abs(value) >= 1e-5 || value === 0 ? String(+value.toPrecision(4)) : value.toExponential(2);
  const axis = (title, logarithmic, more = {}) => ({
    type: logarithmic ? 'logarithmic' : 'linear',
    title: { display: true, text: title, color: colors.muted },
    grid: { color: colors.line, borderColor: colors.line },
    ticks: { color: colors.muted, maxRotation: 0, autoSkipPadding: 12, includeBounds: false, ...(logarithmic ? { callback: decades } : {}) },
    ...more,
  });
  // A logarithmic axis names 1, 2 and 5 of each decade.
  function decades(value) {
    const digit = value / 10 ** Math.floor(Math.log10(value) + 1e-9);
    return [1, 2, 5].some((d) => Math.abs(digit - d) < 1e-6) ? short(+value.toPrecision(3)) : '';
  }

  function lines(chart) {
    const moment = (point) => (point.raw.t === undefined ? '' : `, ${short(point.raw.t)} s`);
    const low = logFloor(chart);
    return {
      type: 'scatter',
      data: {
        datasets: chart.series.map((s, i) => ({
          label: s.name,
          data: s.x.map((x, k) => ({
            x: x ?? NaN,
            y: chart.log && s.y[k] > 0 ? Math.max(low, s.y[k]) : s.y[k] ?? NaN,
            ...(s.t ? { t: s.t[k] } : {}),
          })),
          showLine: !s.dots,
          borderColor: paint(s.color),
          backgroundColor: paint(s.color),
          borderWidth: s.width,
          borderDash: s.dashed ? [6, 4] : [],
          pointRadius: s.dots ? 2 : s.x.length <= 12 ? 3 : 0,
          pointHoverRadius: 4,
          order: -i, // later series above earlier ones
        })),
      },
      options: {
        interaction: { mode: 'nearest', axis: chart.equal ? 'xy' : 'x', intersect: false },
        scales: {
          x: axis(chart.x, false),
          y: axis(chart.y, chart.log, chart.zero ? { beginAtZero: true } : {}),
        },
        plugins: {
          tooltip: {
            filter: (item, i, items) => items.findIndex((other) => other.datasetIndex === item.datasetIndex) === i,
            callbacks: {
              title: (items) => (chart.equal || !items.length ? '' : short(items[0].parsed.x)),
              label: (point) => `${point.dataset.label}: ` + (chart.equal
                ? `(${short(point.parsed.x)}, ${short(point.parsed.y)}) m${moment(point)}` : short(point.parsed.y)),
            },
          },
        },
      },
    };
  }

  // A few tiny errors (2 %) must not flatten the rest of a logarithmic chart.
  function logFloor(chart) {
    const values = chart.series.flatMap((s) => s.y).filter((y) => y > 0).sort((a, b) => a - b);
    if (!values.length) return 0;
    return Math.max(values[0], 10 ** Math.floor(Math.log10(values[Math.floor(values.length / 50)])));
  }

  function bars(chart) {
    return {
      type: 'bar',
      data: {
        labels: chart.labels,
        datasets: chart.series.map((s) => ({
          label: s.name, data: s.values, backgroundColor: paint(s.color), maxBarThickness: 18,
        })),
      },
      options: {
        indexAxis: 'y',
        interaction: { mode: 'index', axis: 'y', intersect: false },
        scales: {
          x: axis(chart.x, chart.log, { stacked: chart.stacked }),
          y: { stacked: chart.stacked, grid: { display: false }, ticks: { color: colors.ink, autoSkip: false } },
        },
        plugins: { tooltip: { callbacks: { label: (p) => `${p.dataset.label}: ${short(p.parsed.x)}` } } },
      },
    };
  }

  // A unit has the same length on both axes.
  function equalize(chart) {
    const area = chart.chartArea;
    if (!chart.$described.equal || !area || !(area.right > area.left)) return;
    const points = chart.data.datasets.filter((d, i) => chart.isDatasetVisible(i)).flatMap((d) => d.data)
      .filter((p) => Number.isFinite(p.x) && Number.isFinite(p.y));
    if (!points.length) return;
    const range = chart.$zoom ?? {
      x: [Math.min(...points.map((p) => p.x)), Math.max(...points.map((p) => p.x))],
      y: [Math.min(...points.map((p) => p.y)), Math.max(...points.map((p) => p.y))],
    };
    const width = area.right - area.left, height = area.bottom - area.top;
    const unit = 1.08 * Math.max((range.x[1] - range.x[0]) / width, (range.y[1] - range.y[0]) / height, 1e-9);
    for (const [key, length] of [['x', width], ['y', height]]) {
      const middle = (range[key][0] + range[key][1]) / 2;
      chart.options.scales[key].min = middle - unit * length / 2;
      chart.options.scales[key].max = middle + unit * length / 2;
    }
  }
  // Ticks change the room that axes take, and so the area: twice is enough.
  function refresh(chart) {
    for (let i = 0; i < 2; ++i) {
      equalize(chart);
      chart.update('none');
    }
  }

  const charts = [];
  function zoomTo(chart, range) {
    const of = chart.$described;
    for (const other of charts) {
      const same = other === chart || (of.group && other.$described.group === of.group && other.$described.x === of.x);
      if (!same) continue;
      other.$zoom = range ?? undefined;
      other.$button.hidden = !range;
      if (!other.$described.equal) {
        other.options.scales.x.min = range?.x[0];
        other.options.scales.x.max = range?.x[1];
      }
      refresh(other);
    }
  }

  // Drag: zoom. Double click, or the button: the whole range. Not by touch, which scrolls the page.
  const zoomByDragging = {
    id: 'zoomByDragging',
    afterInit(chart) {
      const canvas = chart.canvas;
      let start = null;
      const at = (event) => ({ x: event.offsetX, y: event.offsetY });
      canvas.addEventListener('pointerdown', (event) => {
        const p = at(event), area = chart.chartArea;
        const inside = p.x >= area.left && p.x <= area.right && p.y >= area.top && p.y <= area.bottom;
        if (event.pointerType !== 'touch' && event.button === 0 && inside && chart.$described.kind === 'lines') start = p;
      });
      canvas.addEventListener('pointermove', (event) => {
        if (!start) return;
        chart.$box = [start, at(event)];
        chart.draw();
      });
      window.addEventListener('pointerup', () => {
        const box = chart.$box;
        start = chart.$box = null;
        if (!box) return;
        const range = (key) => box.map((p) => chart.scales[key].getValueForPixel(p[key])).sort((a, b) => a - b);
        if (Math.abs(box[0].x - box[1].x) > 8) zoomTo(chart, { x: range('x'), y: range('y') });
        else chart.draw();
      });
      canvas.addEventListener('dblclick', () => zoomTo(chart, null));
    },
    afterDraw(chart) {
      if (!chart.$box) return;
      const [a, b] = chart.$box, area = chart.chartArea, context = chart.ctx;
      const [top, bottom] = chart.$described.equal ? [a.y, b.y] : [area.top, area.bottom];
      context.save();
      context.fillStyle = 'rgba(86, 180, 233, 0.25)';
      context.fillRect(a.x, top, b.x - a.x, bottom - top);
      context.restore();
    },
  };

  function draw() {
    colors = theme();
    charts.splice(0).forEach((chart) => chart.destroy());
    for (const figure of all('figure.chart')) {
      const about = described[Number(figure.dataset.chart)];
      const config = about.kind === 'bars' ? bars(about) : lines(about);
      if (about.kind === 'bars') {
        const perLabel = about.stacked ? 30 : 18 * about.series.length + 14;
        figure.querySelector('.canvas').style.height = `${90 + perLabel * about.labels.length}px`;
      }
      const many = about.kind === 'bars' || about.series.length > 1;
      config.options.plugins.legend = {
        display: many,
        position: 'bottom',
        labels: { color: colors.ink, boxWidth: 22, boxHeight: 3, sort: (a, b) => a.datasetIndex - b.datasetIndex },
      };
      config.options.onResize = (chart) => setTimeout(() => charts.includes(chart) && refresh(chart));
      config.plugins = [zoomByDragging, { id: 'about', beforeInit: (chart) => { chart.$described = about; } }];
      const chart = new Chart(figure.querySelector('canvas'), config);
      const legendClick = Chart.defaults.plugins.legend.onClick;
      chart.options.plugins.legend.onClick = function (event, item, legend) {
        legendClick.call(this, event, item, legend);
        refresh(chart);
      };
      chart.$button = figure.querySelector('button');
      chart.$button.onclick = () => zoomTo(chart, null);
      charts.push(chart);
      refresh(chart);
    }
  }
  draw();
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
})();
