// A camera that orbits a point of the base frame, upright in the world, and the gestures that move it. Screen lengths are
// CSS pixels.

const FIELD = 0.27; // tangent of half the field of view
const UPRIGHT = Math.PI / 2 - 0.001;

// Yaw and pitch of the views of an arm, by name. A hanging arm is seen from below, as in figures: from above, its base
// and the ceiling hide it.
const viewsOf = (hangs) => ({
  "3D": [-0.95, hangs ? -0.12 : 0.4],
  Front: [-Math.PI / 2, 0],
  Side: [0, 0],
  [hangs ? "Bottom" : "Top"]: [-Math.PI / 2, hangs ? -UPRIGHT : UPRIGHT],
});

class Camera {
  // `turn`: the world's axes in the base frame. `word`: how the arm is mounted.
  constructor({ turn, word }) {
    this.turn = turn;
    this.views = viewsOf(word === "hangs");
    this.look("3D");
    this.target = [0, 0, 0];
    this.distance = 1;
    this.middle = [0, 0];
    this.size = [1, 1];
    this.update();
  }

  update() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const inBase = ([x, y, z]) => along(along(scaled(this.turn[0], x), this.turn[1], y), this.turn[2], z);
    this.back = inBase([cp * cy, cp * sy, sp]);
    this.right = inBase([-sy, cy, 0]);
    this.up = inBase([-sp * cy, -sp * sy, cp]);
    this.eye = along(this.target, this.back, this.distance);
    this.focal = Math.min(this.size[0], this.size[1]) / (2 * FIELD);
  }

  // Screen place, distance from the eye along the view, and pixels in a meter there.
  project(point) {
    const v = subtract(point, this.target);
    const depth = Math.max(this.distance - dot(v, this.back), 0.02 * this.distance);
    const scale = this.focal / depth;
    return {
      x: this.middle[0] + dot(v, this.right) * scale,
      y: this.middle[1] - dot(v, this.up) * scale,
      depth,
      scale,
    };
  }

  // Move back until all points fit the screen inside of its margins, and center them.
  fit(points, margin) {
    const [width, height] = this.size;
    const room = [width - margin.left - margin.right, height - margin.top - margin.bottom];
    this.target = scaled(add(...extremes(points)), 0.5);
    this.middle = [width / 2, height / 2];
    for (let round = 0; round < 8; round++) {
      this.update();
      const seen = points.map((point) => this.project(point));
      const box = {
        left: least(seen, "x"),
        right: -least(seen, "x", -1),
        top: least(seen, "y"),
        bottom: -least(seen, "y", -1),
      };
      this.distance *= Math.max((box.right - box.left) / room[0], (box.bottom - box.top) / room[1], 0.05);
      this.middle = [
        this.middle[0] + margin.left + room[0] / 2 - (box.left + box.right) / 2,
        this.middle[1] + margin.top + room[1] / 2 - (box.top + box.bottom) / 2,
      ];
    }
    this.fitted = this.distance;
    this.update();
  }

  look(view) {
    [this.yaw, this.pitch] = this.views[view];
  }

  orbit(dx, dy) {
    this.yaw -= dx * 0.008;
    this.pitch = clamp(this.pitch + dy * 0.008, -UPRIGHT, UPRIGHT);
    this.update();
  }

  zoom(factor) {
    this.distance = clamp(this.distance * factor, this.fitted * 0.15, this.fitted * 5);
    this.update();
  }

  pan(dx, dy) {
    const meter = this.distance / this.focal;
    this.target = along(along(this.target, this.right, -dx * meter), this.up, dy * meter);
    this.update();
  }
}

const least = (places, key, sign = 1) => Math.min(...places.map((place) => sign * place[key]));

// Lowest and highest corner of the box round the points.
function extremes(points) {
  const low = [Infinity, Infinity, Infinity],
    high = [-Infinity, -Infinity, -Infinity];
  for (const point of points) {
    for (let k = 0; k < 3; k++) {
      low[k] = Math.min(low[k], point[k]);
      high[k] = Math.max(high[k], point[k]);
    }
  }
  return [low, high];
}

// Drag orbits, shift or the right button moves, wheel and pinch zoom, two fingers move.
function listenToGestures(canvas, camera, changed) {
  const fingers = new Map();
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return { distance: Math.hypot(a.x - b.x, a.y - b.y) || 1, x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
  };
  canvas.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    canvas.setPointerCapture(event.pointerId);
    canvas.classList.add("dragging");
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const before = fingers.size === 2 ? spread() : null;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (before) {
      const after = spread();
      camera.zoom(before.distance / after.distance);
      camera.pan(after.x - before.x, after.y - before.y);
    } else if (fingers.size === 1) {
      const moves = event.shiftKey || event.buttons & 2;
      camera[moves ? "pan" : "orbit"](event.clientX - last.x, event.clientY - last.y);
    }
    changed();
  });
  const release = (event) => {
    fingers.delete(event.pointerId);
    canvas.classList.toggle("dragging", fingers.size > 0);
  };
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, release);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      camera.zoom(Math.exp(clamp(event.deltaY * (event.deltaMode ? 16 : 1), -120, 120) * 0.0016));
      changed();
    },
    { passive: false },
  );
}
