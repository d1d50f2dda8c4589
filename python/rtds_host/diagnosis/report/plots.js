// Measured against replay: the way over the floor, then each channel and beside it what a replay misses, on one time axis.
// Lines are replays, dots what was measured, on top. Colours are the page's, each line with a dash pattern of its own.
// The wheel alone scrolls the page; Ctrl and wheel, a drag, two fingers, keys and buttons zoom.
"use strict";
(() => {
  const holder = document.getElementById("plots");
  if (!holder) return;
  const data = JSON.parse(document.getElementById("traces").textContent);
  const { paths, channels } = JSON.parse(document.getElementById("paths").textContent);
  const lines = [["nominal", [8, 4], 1.6], ["refit", [2, 3], 1.8], ["after", [], 2], ["measured", [], 1]];
  const words = { measured: "measured", nominal: "replay, nominal", refit: "replay, motor values refitted",
    after: "replay with the included effects" };
  const spoken = { measured: "measured", nominal: "nominal", refit: "refitted", after: "with effects" };
  const runs = Object.keys(data);
  const present = new Set(runs.flatMap((r) => Object.values(data[r]).flatMap((t) => Object.keys(t))));
  // Where nothing is included, the refitted robot is the best replay there is.
  const shown = { measured: true, nominal: true, refit: !present.has("after"), after: true };
  const style = () => getComputedStyle(document.documentElement);
  const select = document.getElementById("run"), readout = document.getElementById("readout");
  for (const run of runs) select.add(new Option(run, run));
  const margin = { left: 58, right: 8, top: 8, bottom: 34 };
  let span = [0, 1], full = [0, 1], panels = [], at = null;

  const make = (tag, name, parent) => {
    const element = document.createElement(tag);
    if (name) element.className = name;
    if (parent) parent.append(element);
    return element;
  };

  function extent(values, low, high) {
    for (const v of values) if (v !== null) { if (v < low) low = v; if (v > high) high = v; }
    return [low, high];
  }

  function ticks(low, high, count) {
    const raw = (high - low) / count || 1;
    const power = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw * (1 - 1e-12));
    const result = [];
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) result.push(Math.abs(v) < 1e-6 * step ? 0 : +v.toPrecision(10));
    return result;
  }

  // The sample next to a time.
  function nearest(t, when) {
    let low = 0, high = t.length - 1;
    while (high - low > 1) { const mid = (low + high) >> 1; if (t[mid] < when) low = mid; else high = mid; }
    return when - t[low] <= t[high] - when ? low : high;
  }

  // What a panel shows: the lines of a trace, or measured minus each replay.
  function curves(trace, missed) {
    const found = {};
    for (const [key] of lines) {
      if (!shown[key] || !trace[key] || (missed && key === "measured")) continue;
      found[key] = missed
        ? trace[key].map((v, k) => (v === null || trace.measured[k] === null ? null : trace.measured[k] - v)) : trace[key];
    }
    return found;
  }

  function prepared(canvas) {
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    if (!w || !h) return null;
    canvas.width = w * ratio; canvas.height = h * ratio;
    const g = canvas.getContext("2d");
    g.scale(ratio, ratio);
    g.font = "12px system-ui, sans-serif";
    return { g, w, h };
  }

  // Replays as lines, measured as dots on top of them.
  function strokes(g, look, drawn, px, py) {
    for (const [key, dash, width] of lines) {
      if (!drawn[key]) continue;
      const [xs, ys] = drawn[key];
      if (key === "measured") {
        g.fillStyle = look.getPropertyValue("--measured").trim();
        ys.forEach((v, k) => { if (v !== null && xs[k] !== null) g.fillRect(px(xs[k]) - 1.1, py(v) - 1.1, 2.2, 2.2); });
        continue;
      }
      g.strokeStyle = look.getPropertyValue("--" + key).trim(); g.lineWidth = width; g.setLineDash(dash);
      g.beginPath();
      let pen = false;
      ys.forEach((v, k) => {
        if (v === null || xs[k] === null) return;
        if (pen) g.lineTo(px(xs[k]), py(v)); else g.moveTo(px(xs[k]), py(v));
        pen = true;
      });
      g.stroke();
    }
    g.setLineDash([]);
  }

  function grid(g, look, w, h, px, py, xs, ys, unit) {
    const { left, right, top, bottom } = margin;
    g.fillStyle = look.getPropertyValue("--soft").trim(); g.strokeStyle = look.getPropertyValue("--faint").trim(); g.lineWidth = 1;
    g.textAlign = "right"; g.textBaseline = "middle";
    for (const v of ys) {
      g.beginPath(); g.moveTo(left, py(v)); g.lineTo(w - right, py(v)); g.stroke();
      g.fillText(String(v), left - 6, py(v));
    }
    g.textBaseline = "top";
    for (const v of xs) {
      g.beginPath(); g.moveTo(px(v), top); g.lineTo(px(v), h - bottom); g.stroke();
      // At the right edge the label ends there.
      g.textAlign = px(v) > w - 24 ? "right" : "center";
      g.fillText(v + unit, Math.min(px(v), w - 2), h - bottom + 4);
    }
    g.textAlign = "center";
  }

  function drawTrace(panel) {
    const place = prepared(panel.canvas);
    if (!place) return;
    const { g, w, h } = place, { trace, missed } = panel, look = style(), { left, right, top, bottom } = margin;
    const inside = trace.t.map((t) => t >= span[0] && t <= span[1]);
    const drawn = curves(trace, missed);
    let low = Infinity, high = -Infinity;
    for (const values of Object.values(drawn)) [low, high] = extent(values.filter((_, k) => inside[k]), low, high);
    const band = missed && trace.noise ? 3 * trace.noise : 0;
    if (band) { low = Math.min(low, -band); high = Math.max(high, band); }
    if (!(low <= high)) { low = -1; high = 1; }
    const pad = 0.06 * (high - low) || 0.5;
    low -= pad; high += pad;
    const px = (t) => left + (t - span[0]) / (span[1] - span[0]) * (w - left - right);
    const py = (v) => top + (high - v) / (high - low) * (h - top - bottom);
    if (band) {
      g.fillStyle = look.getPropertyValue("--band").trim();
      g.fillRect(left, py(band), w - left - right, py(-band) - py(band));
    }
    grid(g, look, w, h, px, py, ticks(span[0], span[1], Math.max(2, Math.min(8, Math.floor(w / 90)))), ticks(low, high, h < 140 ? 3 : 5), " s");
    g.fillText("time from the run's start", 0.5 * (left + w - right), h - bottom + 18);
    g.save(); g.beginPath(); g.rect(left, top, w - left - right, h - top - bottom); g.clip();
    strokes(g, look, Object.fromEntries(Object.entries(drawn).map(([key, ys]) => [key, [trace.t, ys]])), px, py);
    g.restore();
    panel.canvas.dataset.drawn = "1";
  }

  // One metre is as long in both directions.
  function drawPath(panel) {
    const place = prepared(panel.canvas);
    if (!place) return;
    const { g, w, h } = place, { path } = panel, look = style(), { left, right, top, bottom } = margin;
    let xs = [Infinity, -Infinity], ys = [Infinity, -Infinity];
    for (const [key] of lines) if (shown[key] && path.x[key]) { xs = extent(path.x[key], ...xs); ys = extent(path.y[key], ...ys); }
    if (!(xs[0] <= xs[1])) { xs = [-1, 1]; ys = [-1, 1]; }
    const wide = w - left - right, tall = h - top - bottom;
    const metre = Math.min(wide / (1.1 * (xs[1] - xs[0]) || 0.1), tall / (1.1 * (ys[1] - ys[0]) || 0.1));
    const [cx, cy] = [0.5 * (xs[0] + xs[1]), 0.5 * (ys[0] + ys[1])];
    const px = (v) => left + 0.5 * wide + (v - cx) * metre, py = (v) => top + 0.5 * tall - (v - cy) * metre;
    grid(g, look, w, h, px, py, ticks(cx - 0.5 * wide / metre, cx + 0.5 * wide / metre, Math.max(2, Math.floor(w / 90))),
      ticks(cy - 0.5 * tall / metre, cy + 0.5 * tall / metre, 5), " m");
    g.fillText("x; upwards y", 0.5 * (left + w - right), h - bottom + 18);
    strokes(g, look, Object.fromEntries(lines.filter(([key]) => shown[key] && path.x[key]).map(([key]) => [key, [path.x[key], path.y[key]]])), px, py);
    if (at !== null) {
      const k = nearest(path.t, at);
      for (const [key] of lines) {
        if (!shown[key] || !path.x[key] || path.x[key][k] === null) continue;
        g.fillStyle = look.getPropertyValue("--" + key).trim(); g.strokeStyle = look.getPropertyValue("--ink").trim();
        g.beginPath(); g.arc(px(path.x[key][k]), py(path.y[key][k]), 5, 0, 7); g.fill(); g.stroke();
      }
    }
    panel.canvas.dataset.drawn = "1";
  }

  const draw = (panel) => (panel.path ? drawPath(panel) : drawTrace(panel));
  let due = false;
  const soon = (work) => { if (!due) { due = true; requestAnimationFrame(() => { due = false; work(); }); } };

  function figures(panel) {
    const { trace, missed } = panel, k = nearest(trace.t, at), drawn = curves(trace, missed);
    const told = Object.entries(drawn).reverse().filter(([, v]) => v[k] !== null)
      .map(([key, v]) => spoken[key] + " " + +v[k].toPrecision(4));
    return trace.t[k].toFixed(3) + " s: " + told.join(", ") + " " + trace.unit;
  }

  // The reading line in every plot, the figures at it in the plot that is pointed at.
  function point(panel, when) {
    at = when === null ? null : Math.max(span[0], Math.min(span[1], when));
    for (const one of panels) {
      if (one.path) { drawPath(one); continue; }
      one.line.hidden = at === null;
      one.tip.hidden = at === null || one !== panel;
      if (at === null) continue;
      const wide = one.canvas.clientWidth - margin.left - margin.right;
      const x = margin.left + (at - span[0]) / (span[1] - span[0]) * wide;
      one.line.style.left = x + "px";
      if (one === panel) {
        one.tip.textContent = figures(one);
        one.tip.style[x > 0.5 * one.canvas.clientWidth ? "right" : "left"] = margin.left + "px";
        one.tip.style[x > 0.5 * one.canvas.clientWidth ? "left" : "right"] = "auto";
      }
    }
  }

  const redraw = () => { panels.forEach(draw); point(null, null); };

  function look(from, width) {
    const wide = Math.max(Math.min(width, full[1] - full[0]), Math.min(0.01, full[1] - full[0]));
    const start = Math.max(full[0], Math.min(from, full[1] - wide));
    span = [start, start + wide];
    redraw();
  }
  const zoom = (scale, when = 0.5 * (span[0] + span[1])) => {
    const width = (span[1] - span[0]) * scale;
    look(when - (when - span[0]) * scale, width);
  };
  const pan = (share) => look(span[0] + share * (span[1] - span[0]), span[1] - span[0]);
  const whole = () => look(full[0], full[1] - full[0]);

  function attach(panel) {
    const { canvas, pick } = panel, fingers = new Map();
    const time = (x) => {
      const box = canvas.getBoundingClientRect();
      return span[0] + (x - box.left - margin.left) / (box.width - margin.left - margin.right) * (span[1] - span[0]);
    };
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      zoom(Math.exp(0.0015 * event.deltaY), time(event.clientX));
    }, { passive: false });
    let from = null;
    canvas.addEventListener("pointerdown", (event) => {
      fingers.set(event.pointerId, event.clientX);
      from = event.clientX;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!fingers.has(event.pointerId)) { soon(() => point(panel, time(event.clientX))); return; }
      if (fingers.size === 2) {
        const width = () => { const [a, b] = fingers.values(); return Math.max(Math.abs(a - b), 10); };
        const before = width();
        fingers.set(event.pointerId, event.clientX);
        const [a, b] = fingers.values();
        zoom(before / width(), time(0.5 * (a + b)));
      } else if (event.pointerType === "touch") {
        const step = time(fingers.get(event.pointerId)) - time(event.clientX);
        fingers.set(event.pointerId, event.clientX);
        look(span[0] + step, span[1] - span[0]);
      } else {
        const box = canvas.getBoundingClientRect();
        const [a, b] = [from, event.clientX].sort((x, y) => x - y);
        pick.hidden = b - a < 4;
        pick.style.left = a - box.left + "px"; pick.style.width = b - a + "px";
      }
    });
    const done = (event) => {
      const mouse = event.pointerType !== "touch" && fingers.size === 1;
      fingers.delete(event.pointerId);
      pick.hidden = true;
      if (event.type === "pointerup" && mouse && from !== null && Math.abs(event.clientX - from) >= 4) {
        const [a, b] = [time(from), time(event.clientX)].sort((x, y) => x - y);
        look(a, b - a);
      }
      from = null;
    };
    canvas.addEventListener("pointerup", done);
    canvas.addEventListener("pointercancel", done);
    canvas.addEventListener("pointerleave", () => point(null, null));
    canvas.addEventListener("dblclick", whole);
    canvas.addEventListener("keydown", (event) => {
      const step = (span[1] - span[0]) / 100 * (event.shiftKey ? 10 : 1);
      const now = at === null ? 0.5 * (span[0] + span[1]) : at;
      const acts = {
        ArrowLeft: () => point(panel, now - step), ArrowRight: () => point(panel, now + step),
        "+": () => zoom(0.5, now), "=": () => zoom(0.5, now), "-": () => zoom(2, now), 0: whole,
        Home: () => point(panel, span[0]), End: () => point(panel, span[1]), Escape: () => point(null, null) };
      if (!acts[event.key] || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      acts[event.key]();
      if (at !== null && event.key !== "Escape") readout.textContent = figures(panel);
    });
  }

  // What a reader who does not see the plot is told of it.
  function label(run, name, trace, missed) {
    const known = channels[name];
    const ends = (values) => extent(values, Infinity, -Infinity).map((v) => +v.toPrecision(3)).join(" to ");
    const drawn = Object.entries(curves(trace, missed)).reverse().map(([key, v]) => spoken[key] + " " + ends(v));
    return (missed ? "What a replay misses of " : "") + known.name + ", run " + run + ", " + trace.unit + ": " + drawn.join("; ")
      + (known.note ? "; " + known.note : "") + ". Arrow keys read values.";
  }

  function framed(parent, name) {
    const frame = make("div", "frame", parent), canvas = make("canvas", name, frame);
    canvas.setAttribute("role", "img");
    return { frame, canvas };
  }

  function show(run) {
    holder.replaceChildren();
    panels = [];
    full = [Infinity, -Infinity];
    at = null;
    if (Object.hasOwn(paths, run)) {
      const box = make("figure", "way", holder);
      make("h3", "", box).textContent = "Way over the floor";
      const { canvas } = framed(box, "path");
      canvas.dataset.path = "1";
      const path = paths[run], ends = (v) => extent(v, Infinity, -Infinity).map((e) => e.toFixed(2)).join(" to ");
      canvas.setAttribute("aria-label", "Way over the floor, run " + run + ": measured x " + ends(path.x.measured) + " m, y "
        + ends(path.y.measured) + " m, beside the replays");
      panels.push({ canvas, path });
    }
    for (const [name, trace] of Object.entries(data[run])) {
      full = extent(trace.t, full[0], full[1]);
      const box = make("figure", "plot", holder), head = make("figcaption", "", box);
      make("h3", "", head).textContent = channels[name].name + (trace.unit ? " [" + trace.unit + "]" : "");
      if (channels[name].note) make("span", "small soft", head).textContent = channels[name].note;
      for (const missed of [false, true]) {
        const { frame, canvas } = framed(box, "");
        canvas.dataset[missed ? "missed" : "channel"] = name;
        canvas.tabIndex = 0;
        canvas.setAttribute("aria-label", label(run, name, trace, missed));
        const panel = { canvas, trace, name, missed, line: make("i", "cursor", frame), tip: make("output", "tip", frame),
          pick: make("i", "pick", frame) };
        panel.line.hidden = panel.tip.hidden = panel.pick.hidden = true;
        panel.tip.setAttribute("aria-hidden", "true");
        attach(panel);
        panels.push(panel);
      }
    }
    span = full.slice();
    redraw();
  }

  const keys = document.getElementById("keys");
  for (const [key, dash, width] of [lines[3], ...lines.slice(0, 3)]) {
    if (!present.has(key)) continue;
    const name = make("label", "key", keys), box = make("input", "", name);
    box.type = "checkbox"; box.checked = shown[key]; box.value = key;
    box.addEventListener("change", () => { shown[key] = box.checked; redraw(); });
    const swatch = make("span", "", name);
    swatch.innerHTML = '<svg width="26" height="8" aria-hidden="true"><path d="M0 4 H26" style="stroke: var(--' + key + "); stroke-width: "
      + (key === "measured" ? 3 : 1.4 * width) + "; stroke-dasharray: " + (key === "measured" ? "2 5" : dash.join(" ") || "none") + '"/></svg>';
    name.append(words[key]);
  }
  select.addEventListener("change", () => show(select.value));
  const acts = { reset: whole, closer: () => zoom(0.5), farther: () => zoom(2), earlier: () => pan(-0.25), later: () => pan(0.25) };
  for (const [id, act] of Object.entries(acts)) document.getElementById(id).addEventListener("click", act);
  window.addEventListener("resize", redraw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  // On paper in the light colours, whatever the screen has.
  window.addEventListener("beforeprint", () => { document.documentElement.dataset.print = "1"; redraw(); });
  window.addEventListener("afterprint", () => { delete document.documentElement.dataset.print; redraw(); });
  if (runs.length) show(runs[0]);
})();
