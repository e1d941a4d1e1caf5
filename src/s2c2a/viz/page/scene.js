// One picture of the run at one time.

class Scene {
  constructor(canvas, run) {
    const camera = new Camera(run.surroundings.mounting);
    Object.assign(this, { canvas, run, camera, context: canvas.getContext("2d"), moved: false });
    this.points = [...contentOf(run), ...rimOf(run.surroundings, 0.35)];
  }

  // Read the canvas's size, and fit the run unless the user has moved the camera.
  resize() {
    this.camera.size = sizeCanvas(this.canvas, this.context);
    if (this.moved) this.camera.update();
    else this.frame();
  }

  frame() {
    const small = this.camera.size[0] < 500;
    this.camera.fit(
      this.points,
      small ? { left: 34, right: 34, top: 50, bottom: 44 } : { left: 80, right: 80, top: 50, bottom: 62 },
    );
  }

  look(view) {
    this.camera.look(view);
    this.moved = false;
    this.frame();
  }

  draw(moments, chosen) {
    const { context, camera, run } = this;
    context.lineJoin = context.lineCap = "round";
    paintSky(context, camera.size);
    paintGround(context, camera, run);
    paintTube(context, camera, run.traces[chosen].tube, run.traces[chosen].color);
    const light = lightOf(camera),
      things = [],
      moment = moments[chosen],
      trace = run.traces[chosen];
    this.pushPaths(things, trace, moment);
    pushObstacles(things, camera, moment.obstacles, run.colors.obstacle);
    if (moment.frames) {
      const sections = sectionsAt(moment.frames, run.mesh);
      pushArm(things, camera, light, sections, run.mesh);
      const { arrow, level } = run.surroundings;
      if (!arrow) paintShadow(context, camera, bodyOf(sections, run), level);
    }
    paintGravity(context, camera, run);
    this.paintGhosts(moments, chosen);
    paintByDepth(context, things);
    this.paintPlan(trace.horizon[moment.place.step]);
    this.paintDesired(moment, trace);
  }

  // The tip that is planned for the next moments, in front of the arm.
  paintPlan(tips) {
    const places = tips.map((tip) => tip && this.camera.project(tip)).filter(Boolean);
    if (places.length) paintLine(this.context, { places, stroke: this.run.colors.horizon, width: 2 });
  }

  pushPaths(things, trace, { place }) {
    const real = trace.frames.map((frames) => frames && frames[trace.followed + 1].position);
    for (const { points } of trace.desired) pushPath(things, this.camera, points, this.run.colors.desired, 2.2);
    const now = Math.min(place.step + 2, real.length);
    pushPath(things, this.camera, real.slice(place.step), tint(trace.color, 0.3), 1.6);
    pushPath(things, this.camera, real.slice(0, now), trace.color, 3, 0.002);
  }

  paintGhosts(moments, chosen) {
    const { context, camera, run } = this;
    moments.forEach(({ frames }, k) => {
      if (k === chosen || !frames) return;
      paintGhost(context, camera, bodyOf(sectionsAt(frames, run.mesh), run), run.traces[k].color);
    });
  }

  paintDesired({ frames, desired, axes }, trace) {
    const { context, camera, run } = this;
    const targets = new Map(desired.map(({ module, point }) => [module, point]));
    for (const { module, axis } of axes) {
      const size = arrowSize(run.arm, module),
        end = frames && frames[module + 1];
      const start = targets.get(module) || (end && end.position);
      if (end) paintArrow(context, camera, end.position, end.z, size, trace.color, 2);
      if (start) paintArrow(context, camera, start, axis, size, run.colors.desired, 2.8);
    }
    for (const { module, point } of desired) {
      const place = camera.project(point);
      if (frames) {
        const places = [camera.project(frames[module + 1].position), place];
        paintLine(context, { places, stroke: run.colors.ink, width: 1.4 });
      }
      paintTarget(context, place, run.colors.desired);
    }
  }
}

// Points that a first view must hold: base, module ends, targets, obstacles; thinned to some hundreds.
function contentOf(run) {
  const points = [[0, 0, 0]];
  const reach = 1.2 * run.arm.lengths.reduce((sum, size) => sum + size, 0); // a wall goes on beyond
  for (const trace of run.traces) {
    const stride = Math.ceil(trace.frames.length / 150);
    const every = (list) => list.filter((_, k) => k % stride === 0).filter(Boolean);
    for (const frames of every(trace.frames)) points.push(...frames.map((frame) => frame.position));
    for (const { points: path } of trace.desired) points.push(...every(path));
    for (const tips of arrowTips(trace, run.arm)) points.push(...every(tips));
    for (const step of every(trace.obstacles))
      points.push(...step.flatMap(cornersOf).filter((corner) => length(corner) < reach));
  }
  return points;
}

const arrowSize = (arm, module) => 0.5 * arm.lengths[module];

// Tips of the desired axes' arrows over time, for each module with a desired axis.
function arrowTips(trace, arm) {
  return trace.axes.map(({ module, points }) => {
    const desired = trace.desired.find((goal) => goal.module === module);
    return points.map((axis, k) => {
      const start = (desired && desired.points[k]) || (trace.frames[k] && trace.frames[k][module + 1].position);
      return axis && start && along(start, unit(axis), arrowSize(arm, module));
    });
  });
}

const cornersOf = ({ center, radius, surface }) =>
  surface.length ? surface.map((offset) => add(center, offset)) : ballCornersOf(center, radius);

const ballCornersOf = (center, radius) =>
  [0, 1, 2].flatMap((axis) =>
    [1, -1].map((side) => {
      const corner = [...center];
      corner[axis] += side * radius;
      return corner;
    }),
  );

function paintSky(context, [width, height]) {
  const sky = context.createLinearGradient(0, 0, 0, height);
  sky.addColorStop(0, "#fbfcfe");
  sky.addColorStop(1, "#e9eef5");
  context.fillStyle = sky;
  context.fillRect(0, 0, width, height);
}

// Match a canvas to the screen's pixels and its context to CSS pixels; returns the size in CSS pixels.
function sizeCanvas(canvas, context) {
  const density = Math.min(devicePixelRatio || 1, 2);
  const [width, height] = [Math.max(canvas.clientWidth, 1), Math.max(canvas.clientHeight, 1)];
  canvas.width = Math.round(width * density);
  canvas.height = Math.round(height * density);
  context.setTransform(density, 0, 0, density, 0, 0);
  return [width, height];
}
