// ---- the column beside the map --------------------------------------------------------------
const LEGEND = {
  mirror: "other possible position of a cone",
  tie: "range between two cones", bearing: "direction of arrival at the time shown",
  ellipse: "contains the cone (90 %)",
  edge: "edge: do not cross", "edge-band": "contains the edge (90 %)",
  taper: "taper", gap: "gap, such as an opening for access",
  "closed-area": "closed to traffic", "open-strip": "behind the edge (no area known)",
  "closed-area-inner": "inside the closed area (90 %)",
  "closed-area-outer": "contains the closed area (90 %)",
};
const hullName = hullLeads ? "work zone" : "hull";  // of a row, it is no work zone
const HULL_LEGEND = {
  hull: `${hullName} (around all cones)`, outline: "line through all cones",
  "hull-inner": `inside the ${hullName} (90 %)`, "hull-outer": `contains the ${hullName} (90 %)`,
};

function select(id) {
  chosen.id = id;
  for (const place of places) place.group.classList.toggle("chosen", place.id === id);
  [...byId("cones").children].forEach((button, index) =>
    button.setAttribute("aria-pressed", order[index] === id));
  fit.shown = id === null || !cones.has(id) ? fit.all : misfits(id);
  describe(id);
  explainPath(id);
  paintPath();
  drawSpark();
  redraw();
}

function describe(id) {
  const details = byId("details");
  details.replaceChildren();
  if (id === null) {
    html("small", "Select a cone on the map or in the list.", details);
    return;
  }
  const anchor = anchors.get(id), cone = cones.get(id);
  const rows = [["cone", id], ["status", messages[anchor.status]], ["ranges", anchor.n_ranges]];
  if (cone) {
    rows.push(["east", metres(anchor.east_m)], ["north", metres(anchor.north_m)]);
    if (known(anchor.lat))
      rows.push(["lat, lon", `${anchor.lat.toFixed(7)}, ${anchor.lon.toFixed(7)}`]);
    rows.push([`uncertainty ${NINETY}`, known(cone.ellipse_semi_major_m)
      ? `± ${metres(cone.ellipse_semi_major_m)}, across ± ${metres(cone.ellipse_semi_minor_m)}`
      : "unknown"]);
    if (mirrors.has(id))
      rows.push(["other position", `${percent(anchor.mirror_probability)} probability`]);
    if (anchor.side_source)
      rows.push(["side decided by", sources[anchor.side_source]]);
    if (known(anchor.mirror_probability_by_ranges))
      rows.push(["other position, by its ranges alone",
                 `${percent(anchor.mirror_probability_by_ranges)} probability`]);
    const n = order.indexOf(id), ties = timeline.ties.filter((tie) => tie.slice(0, 2).includes(n));
    if (ties.length)
      rows.push(["ranges to other cones", ties.map(([a, b, cm, count]) =>
        `${order[a === n ? b : a]} ${metres(cm / 100)} (${count})`).join(", ")]);
    if (bearings[n].size)
      rows.push(["directions of arrival", bearings[n].size]);
    const own = timeline.residual_cm[order.indexOf(id)].filter(known).map(Math.abs);
    if (own.length) {
      own.sort((a, b) => a - b);
      rows.push(["median residual", metres(own[Math.floor(own.length / 2)] / 100)]);
    }
  }
  const list = html("dl", "", details);
  for (const [name, value] of rows) {
    html("dt", name, list);
    html("dd", value, list, name === "cone" ? "name" : "");
  }
}

function centre(id) {
  select(id);
  const cone = cones.get(id);
  if (!cone) return;
  [view.east, view.north] = cone.points[0];
  redraw();
}

function listCones() {
  for (const anchor of report.anchors) {
    const button = html("button", "", byId("cones"));
    button.setAttribute("aria-pressed", "false");
    const swatch = svg("svg", { width: 20, height: 20, viewBox: "-10 -10 20 20",
                                "aria-hidden": "true" }, button);
    if (cones.has(anchor.id))
      svg("path", { class: `mark cone${warned(anchor.status)}`,
                    d: markPath("cone", anchor.status) }, swatch);
    html("span", anchor.id, button, "name");
    const good = anchor.status === "ok";
    html("span", good ? sureness(anchor.id) : STATUS[anchor.status] ?? anchor.status, button,
         `value${good ? "" : " warn"}`);
    button.title = anchor.id;
    button.addEventListener("click", () => centre(anchor.id));
  }
}

function swatchOf(role, parent, status = "ok") {
  const swatch = svg("svg", { width: 34, height: 22, "aria-hidden": "true" }, parent);
  if (role === "cone" || role === "mirror")
    svg("path", { class: `mark ${role}${warned(status)}`, d: markPath(role, status),
                  transform: "translate(17 11)" }, swatch);
  else if (["outline", "inner", "outer", "edge", "taper", "gap", "tie", "bearing"].includes(role))
    svg("line", { class: role, x1: 2, x2: 32, y1: 11, y2: 11 }, swatch);
  else if (role === "ellipse")
    svg("ellipse", { class: role, cx: 17, cy: 11, rx: 14, ry: 8 }, swatch);
  else if (["hull", "closed-area", "open-strip", "edge-band"].includes(role))
    svg("rect", { class: role, x: 2, y: 3, width: 30, height: 16 }, swatch);
  else svg("path", { class: role, d: "M3 11H31" }, swatch);
}

function listLegend() {
  const rows = [["cone", "cone", "ok"]];
  for (const status of ["ambiguous", "ill-conditioned", "not-converged", "does-not-fit", "moved"])
    if ([...cones.values()].some((cone) => cone.status === status))
      rows.push(["cone", `cone: ${STATUS[status]}`, status]);
  rows.push(...Object.entries(LEGEND));
  const roles = new Set(all.map(({ role }) => role));
  if (timeline.ties.length) roles.add("tie");
  if (bearings.some(({ size }) => size)) roles.add("bearing");
  for (const [role, text, status] of rows)
    if (roles.has(role)) legendRow(byId("legend"), role, text, status);
  for (const [role, text] of Object.entries(HULL_LEGEND))
    if (roles.has(role)) legendRow(byId("hull-legend"), role, text);
  byId("hull-part").hidden = ![...roles].some(isHull);
}

function legendRow(parent, role, text, status) {
  const row = html("div", "", parent);
  swatchOf(areaClass(role), row, status);
  html("span", text, row);
}

// What the path's colours mean; in words as well as in width.
function explainPath(id) {
  byId("path-title").textContent = id === null || !cones.has(id)
    ? "Path: residual of all ranges" : `Path: residual of the ranges to ${id}`;
  const rows = byId("path-legend"), unit = fit.width;
  rows.replaceChildren();
  const size = (cm) => Math.round(cm * 10) / 10;
  for (let k = 0; k < (fit.all.some(known) ? 5 : 0); k += 1) {
    const row = html("div", "", rows);
    swatchOf(CLASSES[k + 1], row);
    html("span", k < 4 ? `${size(k * unit)} to ${size((k + 1) * unit)} cm`
                       : `more than ${size(4 * unit)} cm`, row);
  }
  const row = html("div", "", rows);
  swatchOf("none", row);
  html("span", "no range to a located cone", row);
  html("small", "Residual: measured range minus the distance to the position found.", rows);
}

// Between which areas the zone lies, where the inner and the outer region are known.
function areaSureness() {
  const [inner, outer] = ["hull-inner", "hull-outer"]
    .map((role) => all.find((f) => f.role === role));
  if (!outer || !known(outer.area_m2)) return "";
  return ` (at least ${squareMetres(inner?.area_m2 ?? 0)}, at most `
    + `${squareMetres(outer.area_m2)}; 90\u00a0% each)`;
}

function tellStatus() {
  document.title = `GAIA: ${report.scene}`;
  byId("scene").textContent = report.scene;
  const good = report.status === "ok", { boundary } = report;
  html("span", good ? "✓ reliable" : "! needs review", byId("status"), `chip${good ? "" : " warn"}`);
  const area = boundary.status === "ok"
    ? `the zone${good ? "" : " as computed"} covers ${squareMetres(boundary.area_m2)}${areaSureness()}`
    : boundary.status === "collinear" ? "all on one line, so no area"
      : "too few cones for a boundary";
  const found = cones.size === order.length && order.length > 1
    ? `All ${order.length}` : `${cones.size} of ${order.length}`;
  const zone = road === null ? `, ${area}.` : ". ";
  html("span", ` ${found} cones located${zone}`, byId("status"));
  // Names of options are not broken at the end of a line.
  for (const [k, words] of (road?.summary ?? "").split(/(--[a-z-]+)/).entries())
    html(k % 2 ? "code" : "span", words, byId("status"));
  for (const words of road?.details ?? []) html("li", words, byId("road"));
  byId("road-part").hidden = road === null;
  for (const reason of report.reasons) html("li", reason.text, byId("reasons"));
  for (const note of report.notes) html("li", note, byId("notes"));
  byId("log").hidden = !report.notes.length;
  byId("note").textContent = report.uncertainty_note;
  byId("version").textContent = `gaia-uwb ${report.version}`;
}

// ---- light and dark: as the system has it, until the reader says otherwise ------------------
const darkness = matchMedia("(prefers-color-scheme: dark)");

function setTheme(dark) {
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  drawSpark();
}

darkness.addEventListener("change", (event) => setTheme(event.matches));
byId("theme").addEventListener("click",
  () => setTheme(document.documentElement.dataset.theme !== "dark"));
byId("fold").addEventListener("click", () => {
  const hide = !byId("panel").hidden;
  byId("panel").hidden = hide;
  byId("fold").setAttribute("aria-expanded", !hide);
  draw();
  drawSpark();
});
byId("zone").addEventListener("click", showZone);
byId("drive").addEventListener("click", showDrive);
byId("hull-shown").addEventListener("change", (event) => showHull(event.target.checked));
byId("closer").addEventListener("click", () => zoom(1.4));
byId("farther").addEventListener("click", () => zoom(1 / 1.4));
addEventListener("resize", () => {
  redraw();
  drawSpark();
});

// ---- start ----------------------------------------------------------------------------------
setTheme(darkness.matches);
slider.max = Math.max(steps - 1, 0);
byId("clock").textContent = steps ? `0.0 / ${timeline.t_s[steps - 1].toFixed(1)} s` : "";
drawAreas();
showHull(hullLeads);
drawPlaces();
spacing = usualSpacing();
tellStatus();
listCones();
listLegend();
select(null);
showZone();
