// ---------- sliders, for the mouse, the keyboard and fingers ----------

const SLIP = 6;  // a pointer that moves less is a click, not a drag [CSS pixels]

// Calls `act` whenever the user sets a slider. A slider released by mouse or finger loses the focus, so that the next keys control
// the film; a slider reached with the Tab key keeps it. Browsers set a slider as soon as a finger touches it, even if the finger then
// scrolls the page. A touch therefore acts only when the finger moves along the slider or is lifted; if the page is scrolled, the
// slider returns to its earlier value.
function onSlide(slider, act) {
  let touch = null;  // value and finger position at the start of a touch that has not acted yet
  const acts = () => { touch = null; act(); };
  slider.addEventListener('pointerdown', ({ pointerType, clientX }) => { touch = pointerType === 'touch' ? { value: slider.value, from: clientX, scrolls: false } : null; });
  slider.addEventListener('pointermove', ({ clientX }) => { if (touch && !touch.scrolls && Math.abs(clientX - touch.from) > SLIP) acts(); });
  slider.addEventListener('pointerup', () => { if (touch) acts(); });
  slider.addEventListener('pointercancel', () => {
    if (!touch) return;
    touch.scrolls = true;
    slider.value = touch.value;
  });
  for (const end of ['touchend', 'touchcancel']) slider.addEventListener(end, () => { if (touch?.scrolls) touch = null; });
  slider.addEventListener('input', () => {
    if (!touch) act();
    else if (touch.scrolls) slider.value = touch.value;
  });
  let isHeld = false;
  slider.addEventListener('pointerdown', () => { isHeld = true; });
  for (const end of ['pointerup', 'pointercancel', 'change']) slider.addEventListener(end, () => {
    if (isHeld) slider.blur();
    isHeld &&= end === 'change';
  });
}
