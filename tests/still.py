"""JavaScript that tells when an element of a page no longer moves, or the result of a key is shown."""

from __future__ import annotations

LOOK = """selector => {
    let before = '';
    const moves = e => e.getAnimations().some(each => isFinite(each.effect.getComputedTiming().endTime))
        || (e.parentElement ? moves(e.parentElement) : false);
    const look = () => {
        if (window.nepLook !== look) return;
        const found = document.querySelector(selector);
        const {left, top, right, bottom} = found?.getBoundingClientRect() ?? {};
        const now = right > left && !moves(found) ? JSON.stringify([left, top, right, bottom]) : '';
        if (now && now === before) window.nepStill = JSON.parse(now);
        else requestAnimationFrame(look);
        before = now;
    };
    window.nepStill = null;
    window.nepLook = look;
    requestAnimationFrame(look);
}"""
"""Function that stores the rectangle of an element when two consecutive frames show it unmoved.

The page checks this itself: between two queries from Python a busy computer may render no frame, so an
element whose animation is about to start would seem to be at rest.
"""

KEYS_SEEN = """(() => {
    if (window.nepKeysSeen === undefined) {
        window.nepKeysSeen = 0;
        const isModifier = ({key}) => ['Control', 'Shift', 'Alt', 'Meta'].includes(key);
        const seen = (frames) => frames ? requestAnimationFrame(() => seen(frames - 1)) : ++nepKeysSeen;
        window.addEventListener('keydown', (event) => isModifier(event) || seen(3), true);
    }
    return window.nepKeysSeen;
})()"""
"""Number of keys, without modifiers, whose results the page has rendered.

The page moves the focus in a frame after the key press. On a busy computer this takes longer than any pause,
and a key that arrives earlier is handled at the previous place.
"""
