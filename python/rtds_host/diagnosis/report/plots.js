// Measured against replay: one canvas a channel, a common time axis; wheel zooms, dragging pans, double click resets.
"use strict";
(() => {
  const holder = document.getElementById("plots");
  if (!holder) return;
  const data = JSON.parse(document.getElementById("traces").textContent);
  const lines = [["measured", "#9aa7b3"], ["nominal", "#d97706"], ["refit", "#7c5cbf"], ["after", "#15803d"]];
  const shown = { measured: true, nominal: true, refit: false, after: true };
  const runs = Object.keys(data);
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
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) result.push(+v.toPrecision(10));
    return result;
  }

  function draw(panel) {
    const { canvas, trace, name, unit } = panel;
    const ratio = window.devicePixelRatio || 1;
    const w = canvas.clientWidth, h = canvas.clientHeight;
    if (!w || !h) return;
    canvas.width = w * ratio; canvas.height = h * ratio;
    const g = canvas.getContext("2d");
    g.scale(ratio, ratio);
    const left = 58, right = 8, top = 18, bottom = 20;
    const inside = trace.t.map((t) => t >= span[0] && t <= span[1]);
    let low = Infinity, high = -Infinity;
    for (const [key] of lines) {
      if (shown[key] && trace[key]) [low, high] = extent(trace[key].filter((_, k) => inside[k]), low, high);
    }
    if (!(low <= high)) { low = -1; high = 1; }
    const pad = 0.06 * (high - low) || 0.5;
    low -= pad; high += pad;
    const px = (t) => left + (t - span[0]) / (span[1] - span[0]) * (w - left - right);
    const py = (v) => top + (high - v) / (high - low) * (h - top - bottom);
    g.font = "11px system-ui, sans-serif";
    g.fillStyle = "#5c6b7a"; g.strokeStyle = "#eef1f4"; g.lineWidth = 1;
    g.textAlign = "right"; g.textBaseline = "middle";
    for (const v of ticks(low, high, 4)) {
      g.beginPath(); g.moveTo(left, py(v)); g.lineTo(w - right, py(v)); g.stroke();
      g.fillText(String(v), left - 6, py(v));
    }
    g.textAlign = "center"; g.textBaseline = "top";
    for (const t of ticks(span[0], span[1], 8)) {
      g.beginPath(); g.moveTo(px(t), top); g.lineTo(px(t), h - bottom); g.stroke();
      g.fillText(t + " s", px(t), h - bottom + 4);
    }
    g.save(); g.beginPath(); g.rect(left, top, w - left - right, h - top - bottom); g.clip();
    for (const [key, colour] of lines) {
      if (!shown[key] || !trace[key]) continue;
      g.strokeStyle = colour; g.fillStyle = colour; g.lineWidth = key === "measured" ? 1 : 1.6;
      g.beginPath();
      let pen = false;
      trace[key].forEach((v, k) => {
        if (v === null) return;
        if (pen) g.lineTo(px(trace.t[k]), py(v)); else g.moveTo(px(trace.t[k]), py(v));
        pen = true;
      });
      g.stroke();
    }
    g.restore();
    g.fillStyle = "#1d2733"; g.textAlign = "left"; g.textBaseline = "top"; g.font = "600 12px system-ui, sans-serif";
    g.fillText(name + (unit ? " [" + unit + "]" : ""), left, 2);
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
      const canvas = document.createElement("canvas");
      canvas.dataset.channel = name;
      box.append(canvas); holder.append(box);
      attach(canvas);
      panels.push({ canvas, trace, name, unit: trace.unit });
    }
    span = full.slice();
    redraw();
  }

  const keys = document.getElementById("keys");
  const present = new Set(runs.flatMap((r) => Object.values(data[r]).flatMap((t) => Object.keys(t))));
  for (const [key, colour] of lines) {
    if (!present.has(key)) continue;
    const label = document.createElement("label");
    label.className = "key";
    const box = document.createElement("input");
    box.type = "checkbox"; box.checked = shown[key]; box.value = key;
    box.addEventListener("change", () => { shown[key] = box.checked; redraw(); });
    const swatch = document.createElement("i");
    swatch.style.background = colour;
    const words = { measured: "measured", nominal: "replay, nominal", refit: "replay, motor values refitted",
      after: "replay with the blamed effects" };
    label.append(box, swatch, words[key]);
    keys.append(label);
  }
  select.addEventListener("change", () => show(select.value));
  document.getElementById("reset").addEventListener("click", () => { span = full.slice(); redraw(); });
  window.addEventListener("resize", redraw);
  if (runs.length) show(runs[0]);
})();
