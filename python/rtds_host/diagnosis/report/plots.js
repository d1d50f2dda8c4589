// Measured against replay, and beside it what the replay misses: two canvases a channel, a common time axis; wheel zooms,
// dragging pans, double click resets. Colours are the page's, each line with a dash pattern of its own.
"use strict";
(() => {
  const holder = document.getElementById("plots");
  if (!holder) return;
  const data = JSON.parse(document.getElementById("traces").textContent);
  const lines = [["measured", [], 1], ["nominal", [8, 4], 1.6], ["refit", [2, 3], 1.8], ["after", [], 2]];
  const runs = Object.keys(data);
  const present = new Set(runs.flatMap((r) => Object.values(data[r]).flatMap((t) => Object.keys(t))));
  // Where nothing is blamed, the refitted robot is the best replay there is.
  const shown = { measured: true, nominal: true, refit: !present.has("after"), after: true };
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const select = document.getElementById("run");
  for (const run of runs) select.add(new Option(run, run));
  let span = [0, 1], full = [0, 1], panels = [];

  function extent(values, low, high) {
    for (const v of values) if (v !== null) { if (v < low) low = v; if (v > high) high = v; }
    return [low, high];
  }

  function ticks(low, high, count) {
    const raw = (high - low) / count || 1;
    const power = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw);
    const result = [];
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) result.push(Math.abs(v) < 1e-6 * step ? 0 : +v.toPrecision(10));
    return result;
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

  function draw(panel) {
    const { canvas, trace, name, unit, missed } = panel;
    const ratio = window.devicePixelRatio || 1;
    const w = canvas.clientWidth, h = canvas.clientHeight;
    if (!w || !h) return;
    canvas.width = w * ratio; canvas.height = h * ratio;
    const g = canvas.getContext("2d");
    g.scale(ratio, ratio);
    const left = 58, right = 8, top = 18, bottom = 34;
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
      g.fillStyle = colour("band");
      g.fillRect(left, py(band), w - left - right, py(-band) - py(band));
    }
    g.font = "12px system-ui, sans-serif";
    g.fillStyle = colour("soft"); g.strokeStyle = colour("faint"); g.lineWidth = 1;
    g.textAlign = "right"; g.textBaseline = "middle";
    for (const v of ticks(low, high, h < 140 ? 3 : 5)) {
      g.beginPath(); g.moveTo(left, py(v)); g.lineTo(w - right, py(v)); g.stroke();
      g.fillText(String(v), left - 6, py(v));
    }
    g.textBaseline = "top";
    for (const t of ticks(span[0], span[1], Math.max(2, Math.min(8, Math.floor(w / 90))))) {
      g.beginPath(); g.moveTo(px(t), top); g.lineTo(px(t), h - bottom); g.stroke();
      // At the right edge the label ends there.
      g.textAlign = px(t) > w - 24 ? "right" : "center";
      g.fillText(t + " s", Math.min(px(t), w - 2), h - bottom + 4);
    }
    g.textAlign = "center";
    g.fillText("time from the run's start", 0.5 * (left + w - right), h - bottom + 18);
    g.save(); g.beginPath(); g.rect(left, top, w - left - right, h - top - bottom); g.clip();
    for (const [key, dash, width] of lines) {
      if (!drawn[key]) continue;
      g.strokeStyle = colour(key); g.lineWidth = width; g.setLineDash(dash);
      g.beginPath();
      let pen = false;
      drawn[key].forEach((v, k) => {
        if (v === null) return;
        if (pen) g.lineTo(px(trace.t[k]), py(v)); else g.moveTo(px(trace.t[k]), py(v));
        pen = true;
      });
      g.stroke();
    }
    g.restore();
    g.fillStyle = colour("ink"); g.textAlign = "left"; g.textBaseline = "top"; g.font = "600 12px system-ui, sans-serif";
    g.fillText((missed ? "missed of " : "") + name + (unit ? " [" + unit + "]" : ""), left, 2);
    canvas.dataset.drawn = "1";
  }

  const redraw = () => panels.forEach(draw);

  function attach(canvas) {
    const place = (event) => {
      const box = canvas.getBoundingClientRect();
      return span[0] + (event.clientX - box.left - 58) / (box.width - 66) * (span[1] - span[0]);
    };
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const at = place(event), scale = Math.exp(0.0015 * event.deltaY);
      const width = Math.min((span[1] - span[0]) * scale, full[1] - full[0]);
      if (width < 0.01) return;
      let from = at - (at - span[0]) * width / (span[1] - span[0]);
      from = Math.max(full[0], Math.min(from, full[1] - width));
      span = [from, from + width];
      redraw();
    }, { passive: false });
    let grip = null;
    canvas.addEventListener("pointerdown", (event) => { grip = place(event); canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { grip = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (grip === null) return;
      const width = span[1] - span[0];
      const from = Math.max(full[0], Math.min(span[0] + grip - place(event), full[1] - width));
      span = [from, from + width];
      redraw();
    });
    canvas.addEventListener("dblclick", () => { span = full.slice(); redraw(); });
  }

  function show(run) {
    holder.replaceChildren();
    panels = [];
    full = [Infinity, -Infinity];
    for (const [name, trace] of Object.entries(data[run])) {
      full = extent(trace.t, full[0], full[1]);
      const box = document.createElement("div");
      box.className = "plot";
      holder.append(box);
      for (const missed of [false, true]) {
        const canvas = document.createElement("canvas");
        canvas.dataset[missed ? "missed" : "channel"] = name;
        box.append(canvas);
        attach(canvas);
        panels.push({ canvas, trace, name, unit: trace.unit, missed });
      }
    }
    span = full.slice();
    redraw();
  }

  const keys = document.getElementById("keys");
  for (const [key, dash, width] of lines) {
    if (!present.has(key)) continue;
    const label = document.createElement("label");
    label.className = "key";
    const box = document.createElement("input");
    box.type = "checkbox"; box.checked = shown[key]; box.value = key;
    box.addEventListener("change", () => { shown[key] = box.checked; redraw(); });
    const swatch = document.createElement("span");
    swatch.innerHTML = '<svg width="26" height="8"><path d="M0 4 H26" style="stroke: var(--' + key + "); stroke-width: "
      + 1.4 * width + "; stroke-dasharray: " + (dash.join(" ") || "none") + '"/></svg>';
    const words = { measured: "measured", nominal: "replay, nominal", refit: "replay, motor values refitted",
      after: "replay with the blamed effects" };
    label.append(box, swatch, words[key]);
    keys.append(label);
  }
  select.addEventListener("change", () => show(select.value));
  document.getElementById("reset").addEventListener("click", () => { span = full.slice(); redraw(); });
  window.addEventListener("resize", redraw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  // On paper in the light colours, whatever the screen has.
  window.addEventListener("beforeprint", () => { document.documentElement.dataset.print = "1"; redraw(); });
  window.addEventListener("afterprint", () => { delete document.documentElement.dataset.print; redraw(); });
  if (runs.length) show(runs[0]);
})();
