// ---- one moment of the drive: the vehicle, and what its ranges say there --------------------
const slider = byId("slider"), spark = byId("spark"), playing = { timer: null };
const vehicle = svg("circle", { class: "vehicle", r: 6 }, screen);

function showMoment(step) {
  chosen.step = Math.min(Math.max(Math.round(step), 0), steps - 1);
  slider.value = chosen.step;
  slider.setAttribute("aria-valuetext", `${seconds(chosen.step)} after the start`);
  byId("clock").textContent = `${timeline.t_s[chosen.step].toFixed(1)} / `
    + `${timeline.t_s[steps - 1].toFixed(1)} s`;
  if (!chosen.ranges) toggleRanges(true);
  listRanges();
  redraw();
}

function toggleRanges(on = !chosen.ranges) {
  chosen.ranges = on;
  byId("ranges").setAttribute("aria-pressed", on);
  byId("now").hidden = !on;
  if (on) listRanges(); else stop();
  redraw();
}

// Rings of the measured ranges about the vehicle, and a ray from it to each cone.
function drawRays() {
  now.replaceChildren();
  if (!chosen.ranges || !steps) return;
  const k = chosen.step, east = timeline.east_m[k], north = timeline.north_m[k];
  const x = toX(east + origin[0]), y = toY(north + origin[1]);
  order.forEach((id, n) => {
    const range = timeline.range_cm[n][k], cone = cones.get(id);
    if (range === null) return;
    const misfit = timeline.residual_cm[n][k];
    let reach = range / 100;
    if (cone) {
      const [e, s] = cone.points[0];
      // Where the ring misses the cone, it misses it by the misfit; heights are out of it.
      reach = Math.max(Math.hypot(e - origin[0] - east, s - origin[1] - north) + misfit / 100, 0);
    }
    const ring = order.length <= 12 || id === chosen.id;
    if (ring) svg("circle", { class: `range${id === chosen.id ? " chosen" : ""}`, cx: east,
                              cy: north, r: reach, "vector-effect": "non-scaling-stroke" }, now);
    const bearing = bearings[n].get(k);
    if (known(bearing) && (ring || cone)) {
      const turn = bearing * Math.PI / 180, far = reach * view.scale;
      svg("line", { class: "bearing", x1: x, y1: y, x2: x + far * Math.cos(turn),
                    y2: y - far * Math.sin(turn) }, screen);
    }
    if (!cone) return;
    const [toE, toN] = cone.points[0];
    const ends = { x1: x, y1: y, x2: toX(toE), y2: toY(toN) };
    if (id === chosen.id) svg("line", { class: "ray-halo", ...ends }, screen);
    svg("line", { class: fitClass(misfit), ...ends }, screen);
  });
  vehicle.setAttribute("cx", x);
  vehicle.setAttribute("cy", y);
  screen.append(vehicle);
}

function listRanges() {
  const k = chosen.step, table = byId("now-table");
  byId("now-title").textContent = `Ranges at ${seconds(k)}`;
  table.replaceChildren();
  const head = html("tr", "", html("thead", "", table));
  for (const title of ["cone", "measured", "denoised", "residual"])
    html("th", title, head).scope = "col";
  const body = html("tbody", "", table);
  order.forEach((id, n) => {
    const range = timeline.range_cm[n][k], clean = timeline.denoised_cm[n][k];
    const misfit = timeline.residual_cm[n][k], row = html("tr", "", body);
    html("td", id, row, "name");
    html("td", range === null ? "–" : metres(range / 100), row);
    html("td", clean === null ? "–" : metres(clean / 100), row);
    html("td", misfit === null ? "–" : signed(misfit), row);
  });
}

function togglePlay() {
  if (playing.timer !== null) {
    stop();
    return;
  }
  if (!steps) return;
  if (chosen.step >= steps - 1) showMoment(0);
  byId("play").setAttribute("aria-label", "Pause");
  byId("play-icon").setAttribute("d", "M2 1h4v14H2zM10 1h4v14h-4z");
  const start = performance.now(), from = timeline.t_s[chosen.step];
  const speed = Math.max(1, timeline.t_s[steps - 1] / 30);  // the whole drive in half a minute
  const tick = (time) => {
    const t = from + speed * (time - start) / 1000;
    let step = chosen.step;
    while (step < steps - 1 && timeline.t_s[step + 1] <= t) step += 1;
    showMoment(step);
    playing.timer = requestAnimationFrame(tick);
    if (step >= steps - 1) stop();
  };
  playing.timer = requestAnimationFrame(tick);
}

function stop() {
  if (playing.timer !== null) cancelAnimationFrame(playing.timer);
  playing.timer = null;
  byId("play").setAttribute("aria-label", "Play");
  byId("play-icon").setAttribute("d", "M3 1l11 7-11 7z");
}

// The misfit over time, above the slider: where to look.
function drawSpark() {
  const width = spark.clientWidth, height = spark.clientHeight, ratio = devicePixelRatio || 1;
  spark.width = width * ratio;
  spark.height = height * ratio;
  const brush = spark.getContext("2d"), style = getComputedStyle(document.documentElement);
  brush.scale(ratio, ratio);
  const worst = new Map();  // of each column of pixels
  fit.shown.forEach((misfit, k) => {
    const column = Math.floor(k / Math.max(steps - 1, 1) * (width - 1));
    if (known(misfit)) worst.set(column, Math.max(worst.get(column) ?? 0, misfit));
  });
  const wide = Math.max(1, Math.ceil(width / Math.max(steps, 1)));
  for (const [column, misfit] of worst) {
    brush.fillStyle = style.getPropertyValue(`--${fitClass(misfit)}`);
    const tall = Math.min(Math.max(misfit / (5 * fit.width), 0.15), 1) * height;
    brush.fillRect(column, height - tall, wide, tall);
  }
}

slider.addEventListener("input", () => {
  stop();
  showMoment(Number(slider.value));
});
byId("play").addEventListener("click", togglePlay);
byId("ranges").addEventListener("click", () => toggleRanges());
