// ---------- camera: zoom and visible part of the simulation box ----------

// The canvas has the shape of the region that the box covers during the film, including the motion of its sides. At zoom 1 the
// whole region is visible. At larger zoom the view of a periodic box can move across its sides.
const camera = { zoom: 1, x: 0, y: 0, follow: -1 };
const page = { dots: 1, width: 0, height: 0, unit: 1, margin: 3 };  // canvas size, in pixels
const view = { unit: 1, x: 0, y: 0 };  // pixels per unit of length; position of the lower left corner of the canvas

const across = x => (x - view.x) * view.unit, up = y => page.height - (y - view.y) * view.unit;
const backAcross = px => view.x + px / view.unit, backUp = py => view.y + (page.height - py) / view.unit;
const CENTRED = 0.6;  // size of the picture around the centre of mass, relative to the box, in which it moves
const mostZoom = () => Math.max(8, 0.3 * Math.min(...film.edges) / Math.min(...film.radii));

function aim() {
  if (camera.zoom > 1 && isInside(camera.follow)) [camera.x, camera.y] = [X[camera.follow], Y[camera.follow]];
  view.unit = page.unit * camera.zoom;
  if (isCentred()) {
    const { x, y } = totals();
    Object.assign(camera, { x, y });
    view.unit *= CENTRED;
  } else [camera.x, camera.y] = [[camera.x, page.width], [camera.y, page.height]].map(([centre, size], axis) => {
    const low = film.lower[axis], edge = film.edges[axis], half = size / 2 / view.unit, margin = page.margin / view.unit;
    if (film.periodic[axis]) return centre - edge * Math.floor((centre - low) / edge);
    const reach = Math.max(0, edge / 2 + margin - half);  // the camera does not leave a box with walls
    return Math.max(low + edge / 2 - reach, Math.min(low + edge / 2 + reach, centre));
  });
  view.x = camera.x - page.width / 2 / view.unit;
  view.y = camera.y - page.height / 2 / view.unit;
}

function lookAtAll() {
  Object.assign(camera, { zoom: 1, x: film.lower[0] + film.edges[0] / 2, y: film.lower[1] + film.edges[1] / 2, follow: -1 });
}

// Zooms by a factor, keeping the same position in the box at the point (px, py) of the canvas.
function zoom(factor, px = page.width / 2, py = page.height / 2) {
  const x = backAcross(px), y = backUp(py);
  camera.zoom = Math.max(1, Math.min(mostZoom(), camera.zoom * factor));
  const unit = page.unit * camera.zoom;
  camera.x = x + (page.width / 2 - px) / unit;
  camera.y = y - (page.height / 2 - py) / unit;
  if (camera.zoom === 1 && camera.follow < 0) lookAtAll();
}

function pan(dx, dy) {
  camera.follow = -1;
  camera.x -= dx / view.unit;
  camera.y += dy / view.unit;
}

// Periodic images of an object that extends from `low` to `high` are shifted by whole periods: `firstCopy` and `lastCopy` return
// the smallest and the largest number of periods for a visible image.
function firstCopy(axis, high) {
  return film.periodic[axis] ? Math.ceil(((axis ? view.y : view.x) - high) / film.edges[axis]) : 0;
}

function lastCopy(axis, low) {
  const end = axis ? view.y + page.height / view.unit : view.x + page.width / view.unit;
  return film.periodic[axis] ? Math.floor((end - low) / film.edges[axis]) : 0;
}

function copies([x0, x1], [y0, y1], draw) {
  for (let a = firstCopy(0, x1); a <= lastCopy(0, x0); a++)
    for (let b = firstCopy(1, y1); b <= lastCopy(1, y0); b++) draw(a * film.edges[0], b * film.edges[1]);
}
