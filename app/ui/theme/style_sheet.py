"""Style sheet of the application, built from a theme, with rules by class and dynamic property.

The font and the colour of labels are set by the properties ``kind`` and ``role``, see
`app.ui.widgets.label`; those of buttons by ``metrics`` and ``kind``, see `app.ui.widgets.Button`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple, Protocol

from app.ui.theme.icons import icon_svg
from app.ui.theme.style_images import image_url
from app.ui.theme.tokens import TextKind

LABEL_ROLES = (
    "text", "textSecondary", "textTertiary", "textDisabled", "accentText", "ok", "warn", "error", "info",
    "changed", "onAccent", "selectedText",
)  # fmt: skip

EXTRA_KINDS = {"titleLarge": (14.0, 600), "empty": (17.0, 600), "card": (15.0, 600), "lead": (15.0, 400)}
"""Size in px and weight of kinds of labels that the tokens don't define."""


CHECK_BOX_SIDE = 18  # px at 100 %
SWITCH_WIDTH = 36
STEP_MARK_SIZE = 22  # px at 100 %
SWITCH = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="34" height="18"><circle cx="{x}" cy="9" r="7"'
    ' fill="{colour}"/></svg>'
)


class ButtonColours(NamedTuple):
    """Colour roles of a kind of button; None for no fill or no border."""

    fill: str | None
    hovered: str | None
    pressed: str | None
    border: str | None
    text: str


BUTTON_COLOURS: Mapping[str, ButtonColours] = {
    "plain": ButtonColours("panel", "hover", "pressed", "borderStrong", "text"),
    "ghost": ButtonColours(None, "hover", "pressed", None, "text"),
    "link": ButtonColours(None, None, None, None, "accentText"),
    "segment": ButtonColours(None, "pressed", None, None, "textSecondary"),
    "primary": ButtonColours("accent", "accentHover", "accentHover", None, "onAccent"),
    "run": ButtonColours("run", "runHover", "runHover", None, "onRun"),
    "stop": ButtonColours("stop", "stopHover", "stopHover", None, "onStop"),
    "recording": ButtonColours("pressed", "pressed", "pressed", "borderStrong", "error"),
    "replay": ButtonColours("accentTint", "accentTint", "accentTint", "accent", "accentText"),
}
"""Colours of buttons by kind."""

# kind of text, weight and radius of buttons by the property ``metrics``; "" if it isn't set
_BUTTON_FONTS = {
    "": ("body", 500, "control"),
    "small": ("body", 500, "small"),
    "form": ("label", None, "control"),
    "large": ("button", None, "large"),
    "link": ("title", None, "small"),
    "formSegment": ("label", 500, "small"),
}


class ThemeValues(Protocol):
    """Interface of a theme that the style sheet uses."""

    @property
    def is_dark(self) -> bool:
        """True if the theme is dark."""

    @property
    def is_high_contrast(self) -> bool:
        """True if the contrast is high."""

    def hex(self, role: str) -> str:
        """Return the colour of a role as ``#RRGGBB`` or ``#RRGGBBAA``."""

    def radius(self, name: str) -> int:
        """Return a corner radius in px by name."""

    def size(self, *path: str) -> int:
        """Return a length in px by its path in the tokens."""

    def scaled(self, pixels: float) -> float:
        """Scale a length, given in px at 100 % text size, to the current text size."""

    def text_kinds(self) -> Mapping[str, TextKind]:
        """Return the kinds of text by name."""

    def family(self, kind: Literal["text", "mono"]) -> str:
        """Return the font family for text or for code."""


STYLE_SHEET_TEMPLATE = """
QToolTip {{
    background: {tooltip}; color: {tooltipText}; border: 1px solid {tooltip}; padding: 1px 2px;
    font-size: {small_text}px;
}}
QMainWindow, QDialog {{ background: {window}; }}
QMainWindow::separator {{ background: {window}; width: 8px; height: 8px; }}
QMainWindow[density="compact"]::separator {{ width: 6px; height: 6px; }}
QMainWindow::separator:hover {{ background: {pressed}; }}
QSplitter::handle {{ background: {window}; }}

QMenuBar {{ background: transparent; color: {textSecondary}; border: none; spacing: 0; }}
QMenuBar::item {{ background: transparent; padding: 5px 10px; margin: 0; border-radius: {small}px; }}
QMenuBar::item:selected {{ background: {hover}; color: {text}; }}
QMenuBar::item:pressed {{ background: {pressed}; color: {text}; }}
QMenu {{
    background: {raised}; color: {text}; border: 1px solid {borderStrong}; padding: 5px;
    border-radius: {panel_radius}px; menu-scrollable: 1;
}}
QMenu::item {{ padding: 6px 22px 6px 33px; border-radius: {small}px; min-width: 150px; }}
QMenu::item:selected {{ background: {hover}; color: {text}; }}
QMenu::item:disabled {{ color: {textDisabled}; }}
QMenu::icon {{ padding-left: 8px; }}
QMenu::separator {{ height: 1px; background: {border}; margin: 4px 6px; }}
QMenu::scroller {{ height: 22px; background: transparent; }}
QMenu::indicator {{ width: 16px; height: 16px; padding-left: 8px; }}

Button {{ padding: 0 3px; }}
ToggleButton:checked:enabled {{
    background: {selected}; border-color: {accent}; color: {selectedText};
}}
Button[kind="segment"] {{ border-radius: {small}px; }}
Button[kind="segment"]:checked {{ background: {segment}; border: 1px solid {border}; color: {text}; }}
Button[kind="link"] {{ padding: 0; }}
Button[kind="link"]:hover {{ text-decoration: underline; }}
MenuButton {{ padding-right: {menu_button_padding}px; }}
IconButton {{ border: none; border-radius: {small}px; background: transparent; padding: 0; }}
IconButton:hover {{ background: {hover}; }}
IconButton:pressed {{ background: {pressed}; }}
IconButton:checked {{ background: {accentTint}; }}
IconButton[dropTarget="true"] {{ background: {accentTint}; border: 2px solid {accent}; }}

CheckBox {{ spacing: 8px; margin-left: 1px; outline: none; }}
CheckBox:disabled {{ color: {textDisabled}; }}
CheckBox::indicator {{
    width: {check_side}px; height: {check_side}px; padding: 1px; border: 1px solid {controlBorder};
    border-radius: {key}px; background: {field};
}}
CheckBox::indicator:hover, CheckBox::indicator:pressed {{ background: {hover}; }}
CheckBox::indicator:checked {{ background: {accent}; border-color: {accent}; image: url({check_image}); }}
Switch {{ spacing: 10px; margin: 0; font-size: {switch_text}px; }}
Switch::indicator, Switch::indicator:checked:disabled {{
    width: 34px; height: 18px; padding: 0; border: 1px solid {controlBorder}; border-radius: 10px;
    background: {sunken};
}}
Switch::indicator {{ image: url({switch_off_image}); }}
Switch::indicator:hover, Switch::indicator:pressed {{ background: {sunken}; }}
Switch::indicator:checked {{ image: url({switch_on_image}); background: {accent}; }}

ComboBox {{
    background: {field}; color: {text}; border: 1px solid {controlBorder}; border-radius: {control}px;
    padding: 0 9px;
}}
ComboBox:hover {{ background: {hover}; }}
ComboBox:disabled {{ color: {textDisabled}; }}
ComboBox::drop-down {{ subcontrol-origin: content; border: none; width: 16px; padding-left: 2px; }}
ComboBox::down-arrow {{ image: url({combo_image}); width: 16px; height: 16px; }}

SliderTrack::groove, SliderTrack::sub-page {{
    height: {track}px; margin: 0 {track_margin}px; border-radius: {track_radius}px;
    background: {borderStrong};
}}
SliderTrack::sub-page {{ background: {accent}; }}
SliderTrack::handle {{
    width: {handle}px; height: {handle}px; margin: -{track_margin}px; border: 2px solid {accent};
    border-radius: {handle_radius}px; background: {panel};
}}
SliderTrack::sub-page:disabled {{ background: {textDisabled}; }}
SliderTrack::handle:disabled {{ border-color: {textDisabled}; }}

AlertBox[framed="true"] {{
    background: {panel}; border: 1px solid {borderStrong}; border-radius: {panel_radius}px;
}}
AlertBox[framed="true"][status="error"] {{ background: {errorTint}; border-color: {errorBorder}; }}
AlertBox[framed="true"][status="warn"] {{ background: {warnTint}; border-color: {warnBorder}; }}
AlertBox[framed="true"][status="ok"] {{ background: {okTint}; border-color: {okBorder}; }}
AlertBox[framed="true"][status="info"] {{ background: {infoTint}; }}
AppBar {{ background: {window}; }}
Bar {{ background: {panel}; }}

Card {{ background: {panel}; border: 1px solid {border}; border-radius: {card}px; }}
Card[sunken="true"] {{ background: {sunken}; }}
Card[accented="true"] {{ border-color: {accent}; }}
FloatingCard {{ background: {raised}; border: 1px solid {borderStrong}; border-radius: {large}px; }}
Overlay {{ background: {raised}; border: 1px solid {borderStrong}; border-radius: {palette}px; }}
MotionPermissionCard {{ background: {raised}; border: 1px solid {warnBorder}; border-radius: {card}px; }}
_MatchPopup {{ background: {raised}; border: 1px solid {borderStrong}; border-radius: {panel_radius}px; }}
_ReadOnlyRow {{ background: {sunken}; border: 1px solid {borderStrong}; border-radius: {control}px; }}
Legend {{ border: none; border-left: 3px solid {changed}; padding-left: 4px; margin: 2px 0 1px; }}
StatusBar {{ background: {window}; }}
LargeRoom {{ background: {panel}; }}
ArmedStrip[armed="true"] {{ background: {warnTint}; }}
ProblemRow:hover {{ background: {hover}; border-radius: {small}px; margin: 1px 4px; }}
_StepMark {{
    margin: 1px; border: 1px solid {controlBorder}; border-radius: {mark_radius}px; color: {textSecondary};
}}
_StepMark[state="next"] {{ background: {accent}; border-color: {accent}; color: {onAccent}; }}
_StepMark[state="done"] {{ border: none; }}
StepRow[state="next"] {{ background: {accentTint}; border-radius: {panel_radius}px; }}
Segments {{ background: {sunken}; border: {segments_border}; border-radius: {panel_radius}px; }}
IconLabel[tile="empty"] {{ background: {sunken}; border-radius: {palette}px; margin-bottom: 16px; }}
IconLabel[tile="warn"] {{
    background: {warnTint}; border: 1px solid {warnBorder}; border-radius: {panel_radius}px;
}}
QLabel[keyCap="true"] {{ background: {sunken}; border-radius: {key}px; padding: 2px 6px; }}

FieldFrame {{ background: {field}; border: 1px solid {controlBorder}; border-radius: {control}px; }}
FieldFrame[focused="true"] {{ border: 2px solid {accent}; }}
FieldFrame[wrong="true"] {{ border-color: {error}; }}
JsonEdit {{ background: {panel}; }}
QLineEdit, QPlainTextEdit, QTextEdit {{
    background: {field}; color: {text}; border: 1px solid {controlBorder}; border-radius: {control}px;
    padding: 3px 8px; selection-background-color: {selected}; selection-color: {selectedText};
}}
QLineEdit[quiet="true"] {{ border-color: {borderStrong}; }}
QLineEdit[wrong="true"] {{ border-color: {error}; }}
QLineEdit[bare="true"] {{ border: none; border-radius: 0; background: transparent; padding: 0; }}
QLineEdit:disabled {{ color: {textDisabled}; border-color: {border}; }}
QPlainTextEdit[bare="true"], QTextEdit[bare="true"] {{ border: none; border-radius: 0; background: {panel}; }}
QComboBox QAbstractItemView {{
    background: {raised}; color: {text}; border: 1px solid {borderStrong}; padding: 4px; outline: none;
    border-radius: {panel_radius}px;
    selection-background-color: {selected}; selection-color: {selectedText};
}}
QComboBox {{ combobox-popup: 0; }}
QComboBox QAbstractItemView::item {{ padding: 5px 8px; border-radius: {small}px; border: none; }}
QComboBox QAbstractItemView::item:hover {{ background: {hover}; }}
QComboBox QAbstractItemView::item:selected {{ background: {selected}; color: {selectedText}; }}

QAbstractItemView {{
    background: {panel}; color: {text}; border: none; outline: none; alternate-background-color: {sunken};
    selection-background-color: {selected}; selection-color: {selectedText};
}}
QAbstractItemView[raised="true"] {{ background: {raised}; }}
QListView[offers="true"] {{ background: {raised}; border: 1px solid {borderStrong}; padding: 4px; }}
QListView[offers="true"]::item {{ padding: 4px 8px; border-radius: {small}px; border: none; }}
QListView[offers="true"]::item:hover {{ background: {hover}; }}
QListView[offers="true"]::item:selected {{ background: {selected}; color: {selectedText}; }}
QHeaderView {{ background: {panel}; border: none; }}
QHeaderView::section {{
    background: {panel}; color: {textTertiary}; border: none; border-bottom: 1px solid {border};
    padding: 4px 6px; font-size: {small_text}px; font-weight: 500;
}}
QAbstractItemView[raised="true"] QHeaderView::section {{ background: {raised}; }}
QTableCornerButton::section {{ background: {panel}; border: none; border-bottom: 1px solid {border}; }}
QScrollArea {{ background: transparent; border: none; }}
QScrollArea > QWidget > QWidget[bare="true"] {{ background: transparent; }}

QScrollBar:vertical {{ background: transparent; width: 10px; margin: 0; }}
QScrollBar:horizontal {{ background: transparent; height: 10px; margin: 0; }}
QScrollBar::handle {{ background: {borderStrong}; border-radius: 3px; margin: 2px; }}
QScrollBar::handle:vertical {{ min-height: 28px; }}
QScrollBar::handle:horizontal {{ min-width: 28px; }}
QScrollBar::handle:hover {{ background: {controlBorder}; }}
QScrollBar::add-line, QScrollBar::sub-line {{ width: 0; height: 0; border: none; background: none; }}
QScrollBar::add-page, QScrollBar::sub-page {{ background: none; }}
QAbstractScrollArea::corner {{ background: transparent; border: none; }}

Workbench > QTabBar {{ border: none; background: transparent; qproperty-drawBase: 0; }}
Workbench > QTabBar::tab {{ width: 0; height: 0; margin: 0; padding: 0; border: none; }}
"""


def _label_rules(theme: ThemeValues) -> str:
    kinds = {name: (kind.size_px, kind.weight) for name, kind in theme.text_kinds().items()} | EXTRA_KINDS
    rules = []
    for name, (size_px, weight) in kinds.items():
        family = theme.family("mono" if name == "code" else "text")
        rules.append(
            f'QLabel[kind="{name}"] {{ font-family: "{family}"; font-weight: {weight};'
            f" font-size: {round(theme.scaled(size_px))}px; }}"
        )
    rules.extend(f'QLabel[role="{role}"] {{ color: {theme.hex(role)}; }}' for role in LABEL_ROLES)
    return "\n".join(rules)


def _button_rules(theme: ThemeValues) -> str:
    # Rules without an attribute are for the kind "plain" and the size "normal": each attribute and each rule
    # makes the creation of buttons slower.
    def background(role: str | None) -> str:
        return f"background: {theme.hex(role) if role else 'transparent'};"

    rules = []
    for name, (kind_name, weight, radius) in _BUTTON_FONTS.items():
        kind = theme.text_kinds()[kind_name]
        selector = f'Button[metrics="{name}"]' if name else "Button"
        rules.append(
            f"{selector} {{ border-radius: {theme.radius(radius)}px; font-weight: {weight or kind.weight};"
            f" font-size: {round(theme.scaled(kind.size_px))}px; }}"
        )
    for name, colours in BUTTON_COLOURS.items():
        selector = f'Button[kind="{name}"]' if name != "plain" else "Button"
        border = f"border: 1px solid {theme.hex(colours.border)};" if colours.border else "border: none;"
        rules.append(
            f"{selector} {{ {background(colours.fill)} color: {theme.hex(colours.text)}; {border} }}"
        )
        if colours.hovered != colours.fill:
            rules.append(f"{selector}:hover {{ {background(colours.hovered)} }}")
        if colours.pressed != colours.fill:
            rules.append(f"{selector}:pressed, {selector}:checked {{ {background(colours.pressed)} }}")
        is_flat = colours.border is None and colours.fill is None
        border = "" if is_flat else f" border: 1px solid {theme.hex('border')};"
        rules.append(
            f"{selector}:disabled {{ background: transparent; color: {theme.hex('textDisabled')};{border} }}"
        )
    return "\n".join(rules)


class _Roles(dict[str, str]):
    """Mapping of role names to values, with the theme's colours as defaults."""

    def __init__(self, theme: ThemeValues) -> None:
        super().__init__()
        self._theme = theme

    def __missing__(self, role: str) -> str:
        return self._theme.hex(role)


def build(theme: ThemeValues) -> str:
    """Return the style sheet for a theme."""
    roles = _Roles(theme)
    check_side = theme.scaled(CHECK_BOX_SIDE) - 4  # without padding and border
    track, handle = theme.size("sliderTrack"), theme.size("sliderHandle")
    has_border = theme.is_dark or theme.is_high_contrast
    roles.update(
        small=str(theme.radius("small")),
        control=str(theme.radius("control")),
        panel_radius=str(theme.radius("panel")),
        **{name: str(theme.radius(name)) for name in ("key", "large", "card", "palette")},
        segment=theme.hex("pressed" if theme.is_dark else "panel"),
        segments_border=f"1px solid {theme.hex('border')}" if has_border else "none",
        field=theme.hex("sunken") if theme.is_dark else theme.hex("panel"),
        menu_button_padding=str(round(theme.scaled(14)) + 9),
        combo_image=image_url(icon_svg("chevron-down", theme.hex("textSecondary"))),
        mark_radius=str(round(theme.scaled(STEP_MARK_SIZE)) // 2 - 1),
        track=str(track),
        track_radius=str(track // 2),
        track_margin=str((handle - track) // 2),
        handle=str(handle - 4),  # without border
        handle_radius=str(handle // 2),
        check_side=str(round(check_side)),
        check_image=image_url(icon_svg("check", theme.hex("onAccent"), check_side)),
        switch_off_image=image_url(SWITCH.format(x=9, colour=theme.hex("controlBorder"))),
        switch_on_image=image_url(SWITCH.format(x=25, colour=theme.hex("onAccent"))),
        switch_text=str(round(theme.scaled(theme.text_kinds()["bodyLarge"].size_px))),
        small_text=str(round(theme.scaled(theme.text_kinds()["small"].size_px))),
    )
    return _button_rules(theme) + STYLE_SHEET_TEMPLATE.format_map(roles) + _label_rules(theme)
