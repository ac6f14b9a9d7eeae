// The interactive part of a page.  Every number it shows was computed and printed before the page was written;
// here the row nearest to the td that is asked for is looked up, and curves are drawn.
"use strict";
(() => {
  const section = document.getElementById("explorer");
  const data = JSON.parse(document.getElementById("explorer-data").textContent);
  const find = (selector) => section.querySelector(selector);
  const typed = find("#explorer-td"), said = find(".said"), chooser = find("#explorer-flight");
  const charts = {};
  const named = (names, values) => Object.fromEntries(names.map((name, i) => [name, values[i]]));
  for (const one of data.flights) {
    one.rows = one.rows.map(([numbers, texts]) => ({ ...named(one.numbers, numbers), text: named(one.texts, texts) }));
  }
  let flight = data.flights[data.flight], row = flight.rows[flight.start];

  const colour = (name) => getComputedStyle(section).getPropertyValue(`--${name}`).trim();
  const nearest = (td) => flight.rows.reduce((best, one) => Math.abs(one.td - td) < Math.abs(best.td - td) ? one : best);

  // Marks on the canvas of a chart, in its pixels.
  const mark = (chart, name, width, draw) => {
    const context = chart.ctx;
    context.save();
    context.beginPath();
    context.rect(chart.bbox.left, chart.bbox.top, chart.bbox.width, chart.bbox.height);
    context.clip();
    context.strokeStyle = context.fillStyle = colour(name);
    context.lineWidth = width * devicePixelRatio;
    context.beginPath();
    draw(context, (x) => chart.valToPos(x, "x", true), (y) => chart.valToPos(y, "y", true), chart.bbox);
    context.restore();
  };
  const upright = (chart, name, x, dashes = []) => mark(chart, name, 1.5, (context, at, _, box) => {
    context.setLineDash(dashes.map((length) => length * devicePixelRatio));
    context.moveTo(at(x), box.top);
    context.lineTo(at(x), box.top + box.height);
    context.stroke();
  });
  const band = (chart, name, from, to) => mark(chart, name, 1, (context, at, _, box) => {
    context.fillRect(at(from), box.top, at(to) - at(from), box.height);
  });
  // The verified pair is drawn wider than the best one, so that both are seen where they coincide.
  const verified = (chart) => {
    if (!data.verified) return;
    const { tr, td } = data.verified;
    mark(chart, "verified", 4, (context, at, _, box) => [tr, td].forEach((time) => {
      context.moveTo(at(time), box.top);
      context.lineTo(at(time), box.top + box.height);
      context.stroke();
    }));
  };
  const computed = (chart) => data.computed && mark(chart, "verified", 1.5, (context, at, height) => {
    const [time, energy] = data.computed;
    time.forEach((x, i) => context.lineTo(at(x), height(flight.log ? Math.max(energy[i], flight.heights[0]) : energy[i])));
    context.stroke();
  });
  const dot = (chart, x, y) => mark(chart, "switched", 2.5, (context, at, height) => {
    context.arc(at(x), height(y), 6 * devicePixelRatio, 0, 2 * Math.PI);
    context.stroke();
  });

  const marks = {
    energy: {
      below: (chart) => {
        band(chart, "flight", ...flight.flight);
        verified(chart);
      },
      above: (chart) => {
        computed(chart);
        mark(chart, "soft", 1, (context, at, _, box) => {
          const columns = 4 * row.windows.length, left = at(flight.view[0]), width = (at(flight.view[1]) - left) / columns;
          const marked = (i) => i < columns && (parseInt(row.windows[i >> 2], 16) & (8 >> (i & 3))) !== 0;
          for (let from = 0, to = 0; from < columns; from = to + 1) {
            for (to = from; marked(to); to += 1);
            context.fillRect(left + from * width, box.top + 0.95 * box.height, (to - from) * width, 0.05 * box.height);
          }
        });
        mark(chart, "switched", 1.5, (context, _, height, box) => {
          context.moveTo(box.left, height(row.level));
          context.lineTo(box.left + box.width, height(row.level));
          context.stroke();
        });
        if (row.tr !== null) {
          upright(chart, "switched", row.tr, [6, 4]);
          dot(chart, row.tr, row.locked);
        }
      },
    },
    whole: {
      below: (chart) => {
        band(chart, "mark", ...flight.view);
        verified(chart);
      },
      above: (chart) => [row.tr, row.td].filter((time) => time !== null).forEach((time) => upright(chart, "switched", time)),
    },
    motion: {
      below: () => {},
      above: (chart) => [row.tr, row.td].filter((time) => time !== null).forEach((time) => upright(chart, "switched", time, [6, 4])),
    },
    trade: {
      below: () => {},
      above: (chart) => row.error !== null && dot(chart, row.saved, row.error),
    },
  };

  const axis = (label, more) => ({
    stroke: () => colour("ink"), grid: { stroke: () => colour("line"), width: 1 },
    ticks: { stroke: () => colour("line"), width: 1 }, label, labelSize: 20, size: 32, font: "12px system-ui, sans-serif",
    labelFont: "12px system-ui, sans-serif", values: numbers, ...more,
  });
  // Times may have as many digits as 0.1234, so that their numbers need more room.
  const time = (label) => axis(label, { space: 64 });
  const short = (value) => {
    if (value === null) return "";
    const rounded = Number(value.toPrecision(6)), size = Math.abs(rounded);
    const exponential = rounded.toExponential().replace("e+", "e");
    return size >= 1e5 || (size > 0 && size < 1e-3) ? exponential : String(rounded);
  };
  const numbers = (x, values) => values.map(short);
  // A logarithmic axis also has a mark at its end, which is no power of ten.
  const powers = (x, values) => values.map((value) => value === null || Math.abs(Math.log10(value) % 1) > 1e-9 ? "" : short(value));
  const line = (name, more) => ({ stroke: () => colour(name), width: 1.5, points: { show: false }, ...more });
  const points = (name, size) => ({
    paths: () => null, points: { show: true, size, stroke: () => colour(name), fill: () => colour(name) },
  });

  // What each chart shows: height in pixels, scales, series and axes.
  const kinds = {
    energy: () => ({
      height: 320, scales: { x: { time: false, range: flight.view }, y: { distr: flight.log ? 3 : 1, range: flight.heights } },
      series: [{}, line("ink")], axes: [time(flight.time), axis(flight.energy_label, { size: 62, values: flight.log ? powers : numbers })],
      data: flight.energy,
    }),
    whole: () => ({
      height: 90, scales: { x: { time: false, range: (_, low, high) => [low, high] } },
      series: [{}, line("ink", { width: 1 })],
      axes: [time(null), axis(" ", { size: 62, values: () => [] })],
      data: flight.whole,
    }),
    motion: () => ({
      height: 220, scales: { x: { time: false, range: flight.view }, y: { range: (_, low, high) => padded(low, high) } },
      series: [{}, line("ink"), line("switched")],
      axes: [time(flight.time), axis(flight.deformation_label, { size: 62 })], data: motion(),
    }),
    trade: () => ({
      height: 320, scales: { x: { time: false, range: (_, low, high) => padded(low, high) }, y: { range: (_, low, high) => [0, 1.08 * (high || 1)] } },
      series: [{}, points("soft", 4), { ...points("ink", 8), stroke: () => colour("ink") }],
      axes: [axis(flight.saved), axis(flight.error, { size: 54 })], data: trade(),
    }),
  };
  const padded = (low, high) => {
    const room = 0.04 * (high - low || 1);
    return [low - room, high + room];
  };

  // The deformation: that of the reference until tr, as it was locked in until td, then released.
  function motion() {
    const { time, reference, release, preload } = flight.motion;
    const last = time.findIndex((one) => one >= row.td);
    const switched = time.map((one, i) => {
      if (row.deformation === null || row.tr === null) return null;
      if (one < row.tr) return reference[i];
      return one < row.td ? row.deformation : preload + (row.deformation - preload) * release[i - last];
    });
    return [time, reference, switched];
  }

  // Errors over what is saved, those of pairs that another one beats and of the others.
  function trade() {
    const known = flight.rows.filter((one) => one.error !== null).sort((one, other) => one.saved - other.saved);
    const column = (unbeaten) => known.map((one) => Boolean(one.unbeaten) === unbeaten ? one.error : null);
    return [known.map((one) => one.saved), column(false), column(true)];
  }

  function build(name) {
    const place = find(`.${name} .plot`);
    if (!place) return;
    charts[name]?.destroy();
    const { data: values, ...kind } = kinds[name]();
    const hooks = { drawClear: [marks[name].below], draw: [marks[name].above] };
    const options = { width: place.clientWidth, legend: { show: false }, cursor: { show: false }, padding: [10, 12, 0, 0], hooks, ...kind };
    charts[name] = new uPlot(options, values, place);
  }

  // The handle for td, and the marks that follow it.
  const handle = document.createElement("div");
  handle.className = "handle";
  Object.entries({ role: "slider", tabindex: "0", "aria-label": "td, time to switch back to deformable", "aria-orientation": "horizontal" })
    .forEach(([name, value]) => handle.setAttribute(name, value));

  // The cards with a verdict at the top of the page: their pairs, and the names of what they say, which is not repeated here.
  const cards = [...document.querySelectorAll(".card:has(.badge):has(.exact)")].map((card) => ({
    pair: card.querySelector(".exact").textContent,
    names: [...card.querySelectorAll("dt")].map((name) => name.textContent),
  }));

  const spoken = (one) => `td ${one.text.td}, tr ${one.text.tr}, ${one.text.said}`;

  function show(next, message = "") {
    row = next;
    typed.removeAttribute("aria-invalid");
    find(".back").textContent = `Back to td = ${flight.rows[flight.start].text.td}`;
    said.textContent = message;
    typed.value = row.text.td;
    const first = flight.rows[0], last = flight.rows[flight.rows.length - 1];
    Object.entries({ valuemin: first.td, valuemax: last.td, valuenow: row.td, valuetext: spoken(row) })
      .forEach(([name, value]) => handle.setAttribute(`aria-${name}`, value));
    const above = cards.find((card) => card.pair.includes(`tr = ${row.text.exact_tr}, td = ${row.text.exact_td}`));
    section.querySelectorAll("[data-value]").forEach((place) => {
      const text = place.dataset.value === "command" ? data.command.join(row.text.exact_td) : row.text[place.dataset.value] ?? "";
      place.textContent = text;
      const line = place.closest("dl > div");
      line?.classList.toggle("empty", !text || Boolean(above?.names.includes(line.firstChild.textContent)));
    });
    find('[data-value="verdict"]').className = row.text.badge ? `badge ${row.text.badge}` : "";
    find(".earlier").setAttribute("aria-disabled", !findPeak(-1));
    find(".later").setAttribute("aria-disabled", !findPeak(1));
    if (charts.motion) charts.motion.setData(motion(), false);
    follow();
  }

  // Without again, the numbers of the axes stay as they are.
  function follow(again = false) {
    Object.values(charts).forEach((chart) => chart.redraw(false, again));
    handle.style.left = `${charts.energy.valToPos(row.td, "x")}px`;
  }

  function buildAll() {
    Object.keys(kinds).filter((name) => name !== "motion" || flight.motion).forEach(build);
    find(".energy p").textContent = flight.caption;
    const place = find(".motion");
    if (place) place.hidden = !flight.motion;
    if (!flight.motion) {
      charts.motion?.destroy();
      delete charts.motion;
    }
    listen();
    show(row);
  }

  function step(by) {
    const place = flight.rows.indexOf(row) + by;
    show(flight.rows[Math.max(0, Math.min(flight.rows.length - 1, place))]);
  }

  // The next peak of the energy that lies visibly apart from td.
  function findPeak(direction) {
    const apart = 0.005 * (flight.view[1] - flight.view[0]);
    const peaks = flight.rows.filter((one) => one.peak && direction * (one.td - row.td) > apart);
    return direction > 0 ? peaks[0] : peaks[peaks.length - 1];
  }

  function toPeak(direction) {
    const next = findPeak(direction);
    if (next) show(next, spoken(next));
    else said.textContent = direction > 0 ? "No later peak of the energy." : "No earlier peak of the energy.";
  }

  function type(text) {
    const td = text.trim() === "" ? NaN : Number(text.replace(",", "."));
    if (!Number.isFinite(td)) {
      said.textContent = `“${text}” is not a time.`;
      typed.setAttribute("aria-invalid", "true");
      return;
    }
    const next = nearest(td);
    const first = flight.rows[0], last = flight.rows[flight.rows.length - 1];
    const outside = td < first.td || td > last.td;
    const what = outside ? `td was computed from ${first.text.td} to ${last.text.td}` : "this td was not computed";
    show(next, Number(next.text.td) === td || next.td === td ? "" : `${text}: ${what}; the nearest is ${next.text.td}.`);
  }

  // Dragging goes on where the pointer leaves the chart.
  let dragging = null;
  const toPointer = (event) => show(nearest(charts.energy.posToVal(event.clientX - charts.energy.over.getBoundingClientRect().left, "x")));
  document.addEventListener("pointermove", (event) => event.pointerId === dragging && toPointer(event));
  for (const name of ["pointerup", "pointercancel"]) document.addEventListener(name, () => { dragging = null; });

  // Pointers: anywhere in the energy, and at a point of the trade-off.
  function listen() {
    const over = charts.energy.over;
    over.append(handle);
    over.addEventListener("click", toPointer);
    over.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch" && event.target !== handle) return;  // a finger may be about to scroll
      dragging = event.pointerId;
      handle.focus({ preventScroll: true });
      toPointer(event);
      event.preventDefault();
    });
    charts.trade.over.addEventListener("click", (event) => {
      const box = charts.trade.over.getBoundingClientRect();
      const away = (one) => Math.hypot(
        charts.trade.valToPos(one.saved, "x") - event.clientX + box.left, charts.trade.valToPos(one.error, "y") - event.clientY + box.top,
      );
      const known = flight.rows.filter((one) => one.error !== null);
      if (!known.length) return;
      const next = known.reduce((best, one) => away(one) < away(best) ? one : best);
      show(next, spoken(next));
    });
  }

  handle.addEventListener("keydown", (event) => {
    const count = flight.rows.length;
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10, Home: -count, End: count }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    step(by);
  });
  typed.addEventListener("change", () => typed.value !== row.text.td && type(typed.value));
  typed.addEventListener("keydown", (event) => {
    const by = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (event.key === "Enter") type(typed.value);
    if (by === undefined) return;
    event.preventDefault();
    step(by);
  });
  find(".back").addEventListener("click", () => show(flight.rows[flight.start], spoken(flight.rows[flight.start])));
  find(".earlier").addEventListener("click", () => toPeak(-1));
  find(".later").addEventListener("click", () => toPeak(1));
  chooser?.addEventListener("change", () => {
    flight = data.flights[Number(chooser.value)];
    row = flight.rows[flight.start];
    buildAll();
  });

  section.hidden = false;
  document.documentElement.classList.add("live");
  buildAll();
  new ResizeObserver(() => {
    Object.entries(charts).forEach(([name, chart]) => {
      const width = find(`.${name} .plot`).clientWidth;
      if (width && width !== chart.width) chart.setSize({ width, height: chart.height });
    });
    follow(true);
  }).observe(section);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => Object.values(charts).forEach((chart) => chart.redraw()));
})();
