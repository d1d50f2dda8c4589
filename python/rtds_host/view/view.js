// A page of runs: the way over the floor and the paper's panels, each layer in a form of its own, all on one time.
"use strict";
(() => {
  const PANELS = [
    { title: "(a) way over the floor", unit: "m", path: true },
    { title: "(b) wheel speeds", unit: "rad/s", columns: ["w_l", "w_r"], dotted: ["w_ref_l", "w_ref_r"] },
    { title: "(c) armature currents", unit: "A", columns: ["i_l", "i_r"] },
    { title: "(d) pose: x, y [m], heading [rad]", unit: "", columns: ["x", "y", "yaw"], names: ["x", "y", "heading"] },
    { title: "(e) speed errors", unit: "rad/s", columns: ["error_l", "error_r"] },
    { title: "(f) voltages [V], load torques dotted [0.1 N·m]", unit: "", columns: ["v_cmd_l", "v_cmd_r"], dotted: ["torque_l", "torque_r"] },
  ];
  const LAYERS = { nominal: [[7, 4], 1.4], corrected: [[], 2], reference: [[2, 3], 1.3], measured: [null, 1.4] };
  const WORDS = { nominal: "nominal replay (dashed)", corrected: "corrected replay (line)", reference: "reference (dotted)", measured: "measured (dots)" };
  const COLOURS = ["left", "right", "third"];
  const shown = { nominal: true, corrected: true, reference: true, measured: true };
  const $ = (id) => document.getElementById(id);
  const scrub = $("scrub"), play = $("play"), state = $("state");
  let runs = [], cards = [], full = 0, now = 0, playing = false, follows = true, last = 0;

  const make = (tag, name, parent) => { const e = document.createElement(tag); if (name) e.className = name; if (parent) parent.append(e); return e; };

  // Speeds missed: against the reference where there is one, else against what was measured.
  function derive(run) {
    const measured = run.layers.measured || {};
    for (const [name, layer] of Object.entries(run.layers)) for (const side of ["l", "r"]) {
      const w = layer["w_" + side], goal = measured["w_ref_" + side] || (name === "measured" ? null : measured["w_" + side]);
      if (w && goal && (name === "measured") === Boolean(measured["w_ref_" + side]))
        layer["error_" + side] = w.map((v, k) => (v === null || goal[k] === null || goal[k] === undefined ? null : v - goal[k]));
    }
    run.length = Math.max(0, ...Object.values(run.layers).filter((l) => l !== run.layers.reference).map((l) => l.t[l.t.length - 1] || 0));
  }

  function take(news) {
    news.runs.forEach((fresh, k) => {
      if (k >= runs.length) { runs.push({ ...fresh, layers: {} }); }
      const run = runs[k];
      for (const [name, columns] of Object.entries(fresh.layers)) {
        const layer = (run.layers[name] ??= {});
        for (const [column, values] of Object.entries(columns)) {
          // Rows that another answer brought meanwhile are not taken twice.
          const known = (layer[column] ??= []);
          known.push(...values.slice(Math.max(0, known.length - fresh.since)));
        }
      }
      run.done = fresh.done;
      derive(run);
    });
    const before = full;
    full = Math.max(0, ...runs.map((run) => run.length));
    scrub.max = full || 1;
    if (follows || now >= before) now = playing && !follows ? now : full;
    while (cards.length < runs.length) cards.push(card(runs[cards.length]));
    const going = runs.filter((run) => !run.done);
    state.textContent = going.length ? "driving: " + going.map((run) => run.name).join(", ") : "";
    document.body.dataset.done = going.length ? "0" : "1";
    draw();
    return going.length > 0;
  }

  function card(run) {
    const box = make("section", "run", $("runs"));
    const title = make("h2", "", box);
    title.textContent = run.name + (run.robot ? " · " + run.robot : "");
    const sides = make("p", "sides", box);
    make("b", "l", sides).textContent = "left";
    sides.append(" · ");
    make("b", "r", sides).textContent = "right";
    const holder = make("div", "panels", box);
    return PANELS.map((panel) => {
      const figure = make("figure", "", holder);
      make("h3", "", make("figcaption", "", figure)).textContent = panel.title + (panel.unit ? " [" + panel.unit + "]" : "");
      const canvas = make("canvas", "", figure);
      canvas.setAttribute("role", "img");
      return { canvas, panel, run };
    });
  }

  function ticks(low, high, count) {
    const raw = (high - low) / count || 1, power = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw * (1 - 1e-12)), found = [];
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) found.push(Math.abs(v) < 1e-6 * step ? 0 : +v.toPrecision(8));
    return found;
  }

  // (xs, ys, colour, dash or null for dots, width) of all that a panel shows until now.
  function curves({ panel, run }) {
    const found = [];
    for (const [name, [dash, width]] of Object.entries(LAYERS)) {
      const layer = run.layers[name];
      if (!layer || !shown[name]) continue;
      const until = name === "reference" ? layer.t.length : layer.t.findIndex((t) => t > now + 1e-9);
      const cut = (values) => values.slice(0, until < 0 ? undefined : until);
      if (panel.path) {
        if (layer.x && layer.y) found.push({ name, side: name, xs: cut(layer.x), ys: cut(layer.y), colour: { reference: "soft", measured: "ink", nominal: "right", corrected: "left" }[name], dash, width });
        continue;
      }
      if (name === "reference") continue;
      panel.columns.forEach((column, k) => {
        if (layer[column]) found.push({ name, side: (panel.names || ["left", "right"])[k], xs: cut(layer.t), ys: cut(layer[column]), colour: COLOURS[k], dash, width });
      });
      (panel.dotted || []).forEach((column, k) => {
        const scale = column.startsWith("torque") ? 10 : 1;
        if (layer[column]) found.push({ name: column.startsWith("torque") ? "torque" : "reference", side: ["left", "right"][k], xs: cut(layer.t), ys: cut(layer[column]).map((v) => (v === null ? null : v * scale)), colour: COLOURS[k], dash: [2, 3], width: 1.2 });
      });
    }
    return found;
  }

  function extent(values) {
    let low = Infinity, high = -Infinity;
    for (const v of values) if (v !== null) { if (v < low) low = v; if (v > high) high = v; }
    return [low, high];
  }
  const both = (a, b) => [Math.min(a[0], b[0]), Math.max(a[1], b[1])];

  function paint(one) {
    const { canvas, panel, run } = one, ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    if (!w || !h) return;
    canvas.width = w * ratio; canvas.height = h * ratio;
    const g = canvas.getContext("2d"), look = getComputedStyle(document.documentElement), colour = (c) => look.getPropertyValue("--" + c).trim();
    g.scale(ratio, ratio);
    g.font = "12px system-ui, sans-serif";
    const left = 48, right = 8, top = 6, bottom = 22, wide = w - left - right, tall = h - top - bottom, drawn = curves(one);
    let xs = panel.path ? drawn.reduce((all, c) => both(all, extent(c.xs)), [Infinity, -Infinity]) : [0, Math.max(run.length, 1e-3)];
    let ys = drawn.reduce((all, c) => both(all, extent(c.ys)), [Infinity, -Infinity]);
    const empty = !(ys[0] <= ys[1]) || !(xs[0] <= xs[1]);
    if (empty) { xs = panel.path ? [0, 1] : xs; ys = [-1, 1]; }
    if (panel.path) {
      const metre = Math.min(wide / (1.1 * (xs[1] - xs[0]) || 0.1), tall / (1.1 * (ys[1] - ys[0]) || 0.1));
      const cx = 0.5 * (xs[0] + xs[1]), cy = 0.5 * (ys[0] + ys[1]);
      xs = [cx - 0.5 * wide / metre, cx + 0.5 * wide / metre]; ys = [cy - 0.5 * tall / metre, cy + 0.5 * tall / metre];
    } else {
      const pad = 0.06 * (ys[1] - ys[0]) || 0.5;
      ys = [ys[0] - pad, ys[1] + pad];
    }
    const px = (v) => left + (v - xs[0]) / (xs[1] - xs[0]) * wide, py = (v) => top + (ys[1] - v) / (ys[1] - ys[0]) * tall;
    g.fillStyle = colour("soft"); g.strokeStyle = colour("faint");
    g.textAlign = "right"; g.textBaseline = "middle";
    for (const v of ticks(ys[0], ys[1], 5)) { g.beginPath(); g.moveTo(left, py(v)); g.lineTo(w - right, py(v)); g.stroke(); g.fillText(String(v), left - 5, py(v)); }
    g.textBaseline = "top";
    for (const v of ticks(xs[0], xs[1], Math.max(2, Math.floor(w / 90)))) {
      g.beginPath(); g.moveTo(px(v), top); g.lineTo(px(v), h - bottom); g.stroke();
      g.textAlign = px(v) > w - 24 ? "right" : "center";
      g.fillText(v + (panel.path ? " m" : " s"), Math.min(px(v), w - 2), h - bottom + 5);
    }
    g.save(); g.beginPath(); g.rect(left, top, wide, tall); g.clip();
    for (const c of drawn) {
      g.fillStyle = g.strokeStyle = colour(c.colour); g.lineWidth = c.width;
      if (c.dash === null) { c.ys.forEach((v, k) => { if (v !== null && c.xs[k] !== null) g.fillRect(px(c.xs[k]) - c.width / 2, py(v) - c.width / 2, c.width, c.width); }); continue; }
      g.setLineDash(c.dash); g.beginPath();
      let pen = false;
      c.ys.forEach((v, k) => { if (v === null || c.xs[k] === null) return; if (pen) g.lineTo(px(c.xs[k]), py(v)); else g.moveTo(px(c.xs[k]), py(v)); pen = true; });
      g.stroke();
    }
    g.setLineDash([]);
    if (panel.path) for (const c of drawn) {
      // Where it is now; the reference is drawn whole.
      if (c.name === "reference") continue;
      const k = c.ys.length - 1;
      if (k < 0 || c.xs[k] === null || c.ys[k] === null) continue;
      g.fillStyle = colour(c.colour); g.beginPath(); g.arc(px(c.xs[k]), py(c.ys[k]), 5, 0, 7); g.fill();
    }
    g.restore();
    if (empty) { g.fillStyle = colour("soft"); g.textAlign = "center"; g.fillText("not in this run", left + wide / 2, top + tall / 2); }
    canvas.dataset.drawn = String(drawn.length);
    const told = drawn.map((c) => { const k = c.ys.findLastIndex((v) => v !== null); return k < 0 ? "" : c.name + " " + (panel.path ? +c.xs[k].toPrecision(3) + ", " + +c.ys[k].toPrecision(3) : c.side + " " + +c.ys[k].toPrecision(3)); });
    canvas.setAttribute("aria-label", panel.title + ", run " + run.name + ", at " + now.toFixed(2) + " s: " + (told.filter(Boolean).join("; ") || "not in this run"));
  }

  function draw() {
    scrub.value = now;
    $("now").textContent = now.toFixed(2) + " s";
    scrub.setAttribute("aria-valuetext", now.toFixed(2) + " seconds");
    cards.forEach((panels) => panels.forEach(paint));
  }

  function tick(when) {
    if (!playing) return;
    now = Math.min(full, now + (when - last) / 1000 * Number($("pace").value));
    last = when;
    draw();
    if (now >= full && runs.every((run) => run.done)) return stop();
    requestAnimationFrame(tick);
  }
  function stop() { playing = false; play.textContent = "play"; play.setAttribute("aria-pressed", "false"); }
  play.addEventListener("click", () => {
    if (playing) return stop();
    playing = true; follows = false;
    if (now >= full) now = 0;
    play.textContent = "pause"; play.setAttribute("aria-pressed", "true");
    requestAnimationFrame((when) => { last = when; tick(when); });
  });
  scrub.addEventListener("input", () => { now = Number(scrub.value); follows = now >= full; draw(); });
  for (const name of ["measured", "nominal", "corrected", "reference"]) {
    const label = make("label", "", $("keys")), box = make("input", "", label);
    box.type = "checkbox"; box.checked = true; box.value = name;
    box.addEventListener("change", () => { shown[name] = box.checked; draw(); });
    label.append(" " + WORDS[name]);
  }
  window.addEventListener("resize", draw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);

  async function ask() {
    // Rows of the layer that grows; a run that is complete is not asked for again.
    const since = runs.map((run) => (run.layers.measured ? run.layers.measured.t.length : 0));
    let more = true;
    try {
      const answer = await fetch("runs.json?since=" + since.join(","));
      more = take(await answer.json());
    } catch {
      state.textContent = "the program that serves this page has ended; what is shown stays";
      stop();
      return;
    }
    if (more) setTimeout(ask, 200);
  }
  ask();
})();
