// Assembles the page: one state (time, chosen strategy, camera), redrawn whenever it changes.

const run = readRun(JSON.parse(byId("run").textContent));
run.chosen = 0;
let waiting = false;

const scene = new Scene(byId("scene"), run);
const chart = new Chart(byId("chart"), run);
const traceList = new TraceList(run, choose);
const player = new Player(run, redraw);

function choose(k) {
  run.chosen = k;
  writeKey(run, k);
  redraw();
}

// Request one new frame, however many changes there are.
function redraw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(frame);
}

function frame(now) {
  waiting = false;
  player.advance(now);
  draw();
  if (player.playing) redraw();
}

function draw() {
  const moments = run.traces.map((trace) => momentOf(trace, player.time));
  scene.draw(moments, run.chosen);
  if (!chart.empty) chart.draw(player.time, moments, run.chosen);
  traceList.show(moments, run.chosen);
  player.show();
}

function resize() {
  scene.resize();
  if (!chart.empty) chart.resize();
  draw();
}

function listenToChart(canvas) {
  const scrub = (event) => event.buttons && player.go(chart.timeAt(event.clientX));
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    scrub(event);
  });
  canvas.addEventListener("pointermove", scrub);
}

function addViews() {
  byId("views").append(
    ...Object.keys(scene.camera.views).map((view) =>
      element("button", {
        type: "button",
        textContent: view,
        onclick: () => {
          scene.look(view);
          redraw();
        },
      }),
    ),
  );
}

// Start at the second in the address, else play, unless the user prefers reduced motion.
function begin() {
  const named = /^#t=(\d+(?:\.\d+)?)$/.exec(location.hash);
  if (named) player.go(+named[1]);
  else player.play(run.end > run.start && !matchMedia("(prefers-reduced-motion: reduce)").matches);
}

byId("chart-section").hidden = chart.empty;
addViews();
writeSummary(run);
choose(0);
listenToChart(byId("chart"));
listenToGestures(byId("scene"), scene.camera, () => {
  scene.moved = true;
  redraw();
});
addEventListener("keydown", (event) => {
  if (run.traces[+event.key - 1]) choose(+event.key - 1);
});
addEventListener("resize", resize);
addEventListener("click", (event) => {
  // a button clicked with the mouse must not capture the space bar
  if (event.detail) event.target.closest("button")?.blur();
});
resize();
byId("hint").textContent = `grid ${shortNumber(100 * run.surroundings.spacing)} cm`;
begin();
draw();
document.body.dataset.ready = "true";
