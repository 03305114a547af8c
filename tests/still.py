"""JavaScript that determines the position of an element once it has stopped moving and can be clicked."""

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
