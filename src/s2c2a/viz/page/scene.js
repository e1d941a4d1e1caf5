// One picture of the run at one time.

class Scene {
  constructor(canvas, run) {
    Object.assign(this, { canvas, run, camera: new Camera(), context: canvas.getContext("2d"), moved: false });
    const content = contentOf(run);
    const reach = Math.max(
      0.4 * run.arm.lengths.reduce((a, b) => a + b),
      ...content.map((p) => flatReach(p, run.frame)),
    );
    this.ground = groundOf(reach);
    this.points = [...content, ...rimOf(0.6 * this.ground.radius, run.frame)];
    if (run.hangs) this.camera.pitch = -0.12;
  }

  // Take the canvas's size, and frame the run unless the user has moved the camera.
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
    this.camera.look(this.run.hangs && view === "3D" ? [VIEWS[view][0], -0.12] : VIEWS[view]);
    this.moved = false;
    this.frame();
  }

  draw(moments, chosen) {
    const { context, camera, run } = this;
    context.lineJoin = context.lineCap = "round";
    paintSky(context, camera.size);
    paintGround(context, camera, run.frame, this.ground);
    const light = lightOf(camera),
      things = [],
      moment = moments[chosen],
      trace = run.traces[chosen];
    pushBase(things, camera, light, run);
    this.pushPaths(things, trace, moment);
    pushObstacles(things, camera, moment.obstacles);
    if (moment.state) {
      const line = pushArm(things, camera, light, moment.state, run);
      if (run.stands) paintShadow(context, camera, line);
    }
    this.paintGhosts(moments, chosen);
    paintByDepth(context, things);
    this.paintWanted(moment, trace);
  }

  pushPaths(things, trace, { place }) {
    const real = trace.states.map((state) => state && state[trace.followed].position);
    for (const { points } of trace.wanted) pushPath(things, this.camera, points, this.run.wantedColour, 2.2);
    const now = Math.min(place.step + 2, real.length);
    pushPath(things, this.camera, real.slice(place.step), tint(trace.colour, 0.3), 1.6);
    pushPath(things, this.camera, real.slice(0, now), trace.colour, 3, 0.002);
  }

  paintGhosts(moments, chosen) {
    moments.forEach(({ state }, k) => {
      if (k !== chosen && state) paintGhost(this.context, this.camera, state, this.run, this.run.traces[k].colour);
    });
  }

  paintWanted({ state, wanted, axes }, trace) {
    const { context, camera, run } = this;
    const targets = new Map(wanted.map(({ module, point }) => [module, point]));
    for (const { module, axis } of axes) {
      const size = arrowSize(run.arm, module),
        end = state && state[module];
      const start = targets.get(module) || (end && end.position);
      if (end) paintArrow(context, camera, end.position, end.axis, size, trace.colour, 2);
      if (start) paintArrow(context, camera, start, axis, size, run.wantedColour, 2.8);
    }
    for (const { module, point } of wanted) {
      const place = camera.project(point);
      if (state)
        paintLine(context, { places: [camera.project(state[module].position), place], stroke: "#17202b", width: 1.4 });
      paintTarget(context, place, run.wantedColour);
    }
  }
}

// Points that a first view must hold: base, module ends, targets, obstacles; thinned to some hundreds.
function contentOf(run) {
  const points = [[0, 0, 0]];
  for (const trace of run.traces) {
    const stride = Math.ceil(trace.states.length / 150);
    const every = (list) => list.filter((_, k) => k % stride === 0).filter(Boolean);
    for (const state of every(trace.states)) points.push(...state.map((end) => end.position));
    for (const { points: path } of trace.wanted) points.push(...every(path));
    for (const tips of arrowTips(trace, run.arm)) points.push(...every(tips));
    for (const step of every(trace.obstacles)) points.push(...step.flatMap(cornersOf));
  }
  return points;
}

const arrowSize = (arm, module) => 0.5 * arm.lengths[module];

// Where the arrows of wanted axes end, over time, for each module asked.
function arrowTips(trace, arm) {
  return trace.axes.map(({ module, points }) => {
    const wanted = trace.wanted.find((one) => one.module === module);
    return points.map((axis, k) => {
      const start = (wanted && wanted.points[k]) || (trace.states[k] && trace.states[k][module].position);
      return axis && start && along(start, unit(axis), arrowSize(arm, module));
    });
  });
}

const cornersOf = ({ centre, radius }) =>
  [0, 1, 2].flatMap((axis) =>
    [1, -1].map((side) => {
      const corner = [...centre];
      corner[axis] += side * radius;
      return corner;
    }),
  );

const flatReach = (point, { x, y }) => Math.hypot(dot(point, x), dot(point, y));

function paintSky(context, [width, height]) {
  const sky = context.createLinearGradient(0, 0, 0, height);
  sky.addColorStop(0, "#fbfcfe");
  sky.addColorStop(1, "#e9eef5");
  context.fillStyle = sky;
  context.fillRect(0, 0, width, height);
}

// Give a canvas as many pixels as it covers, and a context that counts CSS pixels; returns the size in those.
function sizeCanvas(canvas, context) {
  const density = Math.min(devicePixelRatio || 1, 2);
  const [width, height] = [Math.max(canvas.clientWidth, 1), Math.max(canvas.clientHeight, 1)];
  canvas.width = Math.round(width * density);
  canvas.height = Math.round(height * density);
  context.setTransform(density, 0, 0, density, 0, 0);
  return [width, height];
}
