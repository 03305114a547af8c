"""Where an element of a page stands, told by the page itself: what moves cannot be hit."""

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
"""Notes where an element is, once nothing moves it and it is there in two pictures of the page.

Between two questions of ours there may be no picture, on a busy computer; what just begins to move stands.
"""
