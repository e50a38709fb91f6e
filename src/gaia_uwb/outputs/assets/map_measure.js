// ---- measuring: a line through places that the reader picks; it snaps to cones --------------
const ruler = { active: false, points: [], aim: null };
const SIGMAS_90 = 1.645;  // of a normally distributed length

function toggleRuler(on = !ruler.active) {
  ruler.active = on;
  ruler.points = [];
  ruler.aim = null;
  byId("measure").setAttribute("aria-pressed", on);
  map.classList.toggle("measuring", on);
  hideTip();
  tellRuler();
}

function centreOfMap() {
  const at = { x: map.clientWidth / 2, y: map.clientHeight / 2 };
  return nearestPlace(at) ?? { east: view.east, north: view.north };
}

function addToRuler(place) {
  ruler.points.push(place);
  ruler.aim = null;
  tellRuler();
}

function undoRuler() {
  ruler.points.pop();
  tellRuler();
}

function aimRuler(at) {
  ruler.aim = nearestPlace(at) ?? { east: toEast(at.x), north: toNorth(at.y) };
  redraw();
}

const legM = (a, b) => Math.hypot(b.east - a.east, b.north - a.north);

// How sure a length between two cones is (90 %), from what is known of each; null elsewhere.
function legSureM(a, b) {
  const both = [a, b].map(({ id, role }) => (role === "cone" ? anchors.get(id).covariance_m2 : null));
  const length = legM(a, b);
  if (!both.every(known) || length === 0 || a.id === b.id) return null;
  const e = (b.east - a.east) / length, n = (b.north - a.north) / length;
  const variance = both.reduce((sum, c) => sum + e * e * c[0][0] + 2 * e * n * c[0][1]
                                           + n * n * c[1][1], 0);
  return SIGMAS_90 * Math.sqrt(Math.max(variance, 0));
}

function areaM2(points) {
  const [first] = points;
  return Math.abs(points.reduce((sum, a, k) => {
    const b = points[(k + 1) % points.length];
    return sum + (a.east - first.east) * (b.north - first.north)
           - (b.east - first.east) * (a.north - first.north);
  }, 0)) / 2;
}

function tellRuler() {
  const { points } = ruler;
  byId("measured").hidden = !ruler.active;
  byId("undo").hidden = byId("clear").hidden = !points.length;
  let text = "Click points on the map; the line snaps to cones";
  if (points.length === 1) text = "Click the next point";
  if (points.length > 1) {
    const total = points.slice(1).reduce((sum, b, k) => sum + legM(points[k], b), 0);
    text = metres(total);
    const sure = points.length === 2 ? legSureM(points[0], points[1]) : null;
    if (sure !== null) text += ` ±\u00a0${metres(sure)} ${NINETY}`;
    if (points.length > 2) text += ` in total, area ${squareMetres(areaM2(points))}`;
  }
  byId("measured-text").textContent = text;
  redraw();
}

function drawRuler() {
  if (!ruler.active) return;
  const at = ({ east, north }) => `${toX(east)} ${toY(north)}`;
  const { points, aim } = ruler;
  if (points.length > 2)
    svg("path", { class: "ruler-area", d: `M${points.map(at).join("L")}z` }, screen);
  if (points.length) svg("path", { class: "ruler", d: `M${points.map(at).join("L")}` }, screen);
  if (points.length && aim)
    svg("path", { class: "ruler next", d: `M${at(points.at(-1))}L${at(aim)}` }, screen);
  for (const place of points)
    svg("circle", { class: "ruler-point", cx: toX(place.east), cy: toY(place.north), r: 5 }, screen);
  const ends = aim && points.length ? [...points, aim] : points;
  ends.slice(1).forEach((b, k) => {
    const a = ends[k];
    svg("text", { class: "label", "text-anchor": "middle", x: (toX(a.east) + toX(b.east)) / 2,
                  y: (toY(a.north) + toY(b.north)) / 2 - 8 }, screen).textContent = metres(legM(a, b));
  });
  if (!map.matches(":focus-visible")) return;
  const x = map.clientWidth / 2, y = map.clientHeight / 2;  // what Enter takes
  svg("path", { class: "cross", d: `M${x - 9} ${y}h18M${x} ${y - 9}v18` }, screen);
}

byId("measure").addEventListener("click", () => toggleRuler());
byId("undo").addEventListener("click", undoRuler);
byId("clear").addEventListener("click", () => toggleRuler(true));
