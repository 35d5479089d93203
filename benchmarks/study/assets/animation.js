"use strict";
// Plays the trials of all algorithms side by side, in one time and from one camera.

(() => {
  const data = JSON.parse(document.getElementById("animation-data").textContent);
  const END = Math.max(...data.runs.map(run => run.duration));
  const RED = "#c62828", STILL = "#22313f", LINK = "#c3c9d1", JOINT = "#7d8793";
  const element = id => document.getElementById(id);
  const [play, slider, clock, speed] = ["play", "slider", "time", "speed"].map(element);
  const corners = data.runs.flatMap(run => run.points.filter((_, i) => i % 10 === 0).flat()).concat(data.path);
  const middle = [0, 1, 2].map(k => (Math.min(...corners.map(p => p[k])) + Math.max(...corners.map(p => p[k]))) / 2);
  const reach = Math.max(...corners.map(p => Math.hypot(p[0] - middle[0], p[1] - middle[1], p[2] - middle[2])));
  const camera = new Camera(middle, 3.45 * reach);
  const scenes = data.runs.map(run => new Scene(element(`scene-${run.letter}`), camera));
  let [now, playing, started, last] = [0, false, false, null];

  // State between two frames: positions are interpolated, flags are those of the frame.
  function stateAt(run, t) {
    const at = Math.min(t, run.duration) * data.rate;
    const i = Math.min(Math.floor(at), run.points.length - 1), j = Math.min(i + 1, run.points.length - 1);
    const share = Math.min(at - i, 1), mix = (a, b) => a + (b - a) * share;
    return {
      frame: i,
      points: run.points[i].map((p, k) => p.map((value, m) => mix(value, run.points[j][k][m]))),
      force: run.force[i].map((value, k) => mix(value, run.force[j][k])),
      angle: mix(run.angle[i], run.angle[j]),
      speed: mix(run.speed[i], run.speed[j]),
      limit: run.limit[i] === 1,
      still: run.still[i] === 1,
      done: t >= run.duration,
    };
  }

  function draw() {
    data.runs.forEach((run, number) => {
      const scene = scenes[number], state = stateAt(run, now), points = state.points, tool = points[points.length - 1];
      scene.begin();
      scene.floor([middle[0], middle[1]], 700, 175);
      scene.shadow(points, 45);
      scene.line(data.path, "rgba(60,70,80,.75)", 1.4, { dash: [6, 5], chunk: 6 });
      trace(scene, run, state);
      points.slice(1).forEach((p, i) => {
        const thin = i === points.length - 2;
        scene.tube(points[i], p, thin ? 28 : 52, LINK);
      });
      scene.ball(points[0], 76, JOINT);
      points.slice(1, -1).forEach((p, i) => scene.ball(p, i + 1 === data.elbow ? 70 : 58, i + 1 === data.elbow && state.limit ? RED : JOINT));
      scene.ball(tool, 26, run.colour);
      if (!state.done) scene.arrow(tool, state.force.map(value => 8 * value), STILL);
      scene.end();
      tell(run, state);
    });
    ribbons();
    slider.value = now;
    clock.textContent = `${now.toFixed(2)} s`;
  }

  function trace(scene, run, state) {
    let from = 0;
    const place = i => run.points[i][run.points[i].length - 1];
    // One piece for each stretch with and without contact, so that each has its colour.
    for (let i = 1; i <= state.frame; i++) {
      if (i === state.frame || run.limit[i] !== run.limit[from]) {
        const some = [];
        for (let k = from; k <= i; k++) some.push(place(k));
        if (i === state.frame) some.push(state.points[state.points.length - 1]);
        scene.line(some, run.limit[from] ? RED : run.colour, 3.2, { nearer: 25 });
        from = i;
      }
    }
  }

  function tell(run, state) {
    const box = element(`state-${run.letter}`);
    const [text, kind] = state.done ? [`finished after ${run.duration.toFixed(1)} s`, "done"]
      : state.still ? ["standing still", "still"]
      : state.limit ? ["sliding: elbow at its limit", "limit"] : ["moving freely", "free"];
    if (box.textContent !== text) box.textContent = text;
    box.className = `state ${kind}`;
    const peak = run.peak[state.frame], force = Math.hypot(...state.force);
    const shown = {
      angle: `${state.angle.toFixed(1)}°`, peak: `${peak.toPrecision(2)} rad/s²`,
      speed: `${(1000 * (state.done ? 0 : state.speed)).toFixed(0)} mm/s`, force: `${(state.done ? 0 : force).toFixed(0)} N`,
    };
    for (const [name, value] of Object.entries(shown)) element(`${name}-${run.letter}`).textContent = value;
    element(`peak-${run.letter}`).classList.toggle("bad", peak > data.most * 1.001);
  }

  // What happened when, as a strip for each algorithm over the slider's time.
  function ribbons() {
    const canvas = element("ribbons"), ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
    [canvas.width, canvas.height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    const c = canvas.getContext("2d");
    c.scale(ratio, ratio);
    const row = box.height / data.runs.length;
    data.runs.forEach((run, i) => {
      const kind = k => (run.still[k] ? 2 : run.limit[k]);
      for (let from = 0, k = 1; k <= run.points.length; k++) {
        if (k < run.points.length && kind(k) === kind(from)) continue;
        const [begin, end] = [from, k].map(frame => (Math.min(frame / data.rate, run.duration) / END) * box.width);
        c.fillStyle = [run.colour, RED, STILL][kind(from)];
        c.globalAlpha = kind(from) ? 0.9 : 0.35;
        c.fillRect(begin, i * row + 2, end - begin, row - 4);
        from = k;
      }
      c.globalAlpha = 1;
      c.fillStyle = "#1d2125";
      c.font = "600 11px system-ui, sans-serif";
      c.fillText(run.letter, 4, i * row + row / 2 + 4);
    });
    c.fillStyle = "#000";
    c.fillRect((now / END) * box.width - 1, 0, 2, box.height);
  }

  function tick(stamp) {
    if (!playing) return;
    if (last !== null) now += ((stamp - last) / 1000) * Number(speed.value);
    last = stamp;
    if (now >= END) { now = END; set(false); }
    draw();
    if (playing) requestAnimationFrame(tick);
  }

  function set(on) {
    playing = on;
    last = null;
    play.textContent = on ? "Pause" : "Play";
    if (on) {
      if (now >= END || !started) now = 0;
      started = true;
      requestAnimationFrame(tick);
    }
  }

  play.addEventListener("click", () => set(!playing));
  slider.max = END;
  slider.addEventListener("input", () => { started = true; now = Number(slider.value); draw(); });
  element("view").addEventListener("click", () => { camera.reset(); draw(); });
  element("ribbons").addEventListener("pointerdown", event => {
    const box = event.target.getBoundingClientRect();
    started = true;
    now = Math.max(0, Math.min(END, ((event.clientX - box.left) / box.width) * END));
    draw();
  });
  for (const scene of scenes) {
    scene.canvas.addEventListener("pointerdown", event => scene.canvas.setPointerCapture(event.pointerId));
    scene.canvas.addEventListener("pointermove", event => {
      if (event.buttons) { camera.turn(event.movementX, event.movementY); draw(); }
    });
    scene.canvas.addEventListener("wheel", event => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      camera.zoom(Math.exp(event.deltaY * 0.002));
      draw();
    }, { passive: false });
  }
  new ResizeObserver(draw).observe(element("scenes"));
  // A picture worth looking at before anything is played: half a second into the first contact.
  const contact = Math.max(0, data.runs[0].limit.indexOf(1)) / data.rate;
  now = Math.min(END, contact ? contact + 0.5 : 0.4 * END);
  draw();
})();
