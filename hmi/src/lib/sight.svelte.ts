// Whether Stop can be seen and pressed in this window: what starts motion is offered only then.

/** Below this the page has no room for more than Stop. */
const ROOM_PX = { width: 340, height: 260 } as const;
const LOOK_MS = 250;
/** Rounding of positions. */
const EDGE_PX = 1;

class Sight {
  /** The window is large enough for the areas. */
  roomy = $state(true);
  /** Both Stop buttons are in the part of the page that is seen, and nothing lies over them. */
  stop = $state(true);

  constructor() {
    const look = (): void => this.look();
    for (const target of [window, visualViewport]) target?.addEventListener('resize', look);
    visualViewport?.addEventListener('scroll', look);
    setInterval(look, LOOK_MS);
    look();
  }

  look(): void {
    this.roomy = innerWidth >= ROOM_PX.width && innerHeight >= ROOM_PX.height;
    const keys = [...document.querySelectorAll('[data-stop]')];
    this.stop = keys.length === 2 && keys.every(pressable);
  }
}

/** Whole, and on top where a finger meets it; a page that is zoomed by two fingers shows a part of its window. */
function pressable(key: Element): boolean {
  const { left, right, top, bottom } = key.getBoundingClientRect();
  const { offsetLeft: x = 0, offsetTop: y = 0 } = visualViewport ?? {};
  const { width = innerWidth, height = innerHeight } = visualViewport ?? {};
  const inside =
    right > left &&
    left >= x - EDGE_PX &&
    top >= y - EDGE_PX &&
    right <= x + width + EDGE_PX &&
    bottom <= y + height + EDGE_PX;
  return inside && key.contains(document.elementFromPoint((left + right) / 2, (top + bottom) / 2));
}

export const sight = new Sight();
