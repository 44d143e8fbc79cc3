// Pointers on the picture: dragging a robot pulls its torso, dragging elsewhere turns the camera.

const TURN = 0.006; // [rad/pixel]
const ZOOM = 1.1;

// Listen to pointers on a stage's canvas; `pull(slot, target)` gets where a torso is pulled, null to let go.
export function listen(stage, pull) {
  const { canvas } = stage;
  let held = null;

  canvas.addEventListener("pointerdown", (event) => {
    const hit = stage.hit(event.offsetX, event.offsetY);
    if (!hit) return;
    canvas.setPointerCapture(event.pointerId);
    held = { ...hit, x: event.offsetX, y: event.offsetY };
    move(event);
  });
  canvas.addEventListener("pointermove", move);
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, release);
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    stage.zoom(event.deltaY > 0 ? ZOOM : 1 / ZOOM);
  }, { passive: false });

  function move(event) {
    if (!held) return;
    const { offsetX: x, offsetY: y } = event;
    if (held.slot === null) stage.turn(TURN * (x - held.x), TURN * (y - held.y));
    else pull(held.slot, stage.point(held.area, x, y));
    Object.assign(held, { x, y });
  }

  function release() {
    if (held && held.slot !== null) pull(held.slot, null);
    held = null;
  }
}
