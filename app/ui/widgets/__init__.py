"""Widgets that panels and the shell share. The style sheet paints what consists of boxes, texts and icons.

The widgets are independent of the session and of panels. Buttons, chips and labels are exported by this
package, other widgets by their modules.
"""

from __future__ import annotations

from app.ui.widgets.buttons import Button as Button
from app.ui.widgets.buttons import IconButton as IconButton
from app.ui.widgets.buttons import MenuButton as MenuButton
from app.ui.widgets.buttons import RunButton as RunButton
from app.ui.widgets.buttons import StopButton as StopButton
from app.ui.widgets.buttons import ToggleButton as ToggleButton
from app.ui.widgets.buttons import assign_command as assign_command
from app.ui.widgets.cards import Card as Card
from app.ui.widgets.empty_state import EmptyAction as EmptyAction
from app.ui.widgets.empty_state import EmptyState as EmptyState
from app.ui.widgets.indicators import Chip as Chip
from app.ui.widgets.indicators import Sparkline as Sparkline
from app.ui.widgets.indicators import StatusItem as StatusItem
from app.ui.widgets.indicators import ValueBar as ValueBar
from app.ui.widgets.indicators import paint_sparkline as paint_sparkline
from app.ui.widgets.inputs.combo_box import ComboBox as ComboBox
from app.ui.widgets.inputs.fields import NumberEdit as NumberEdit
from app.ui.widgets.inputs.fields import SearchField as SearchField
from app.ui.widgets.inputs.segments import Segments as Segments
from app.ui.widgets.inputs.slider import SliderWithUnit as SliderWithUnit
from app.ui.widgets.inputs.switch import Switch as Switch
from app.ui.widgets.labels import ElidedLabel as ElidedLabel
from app.ui.widgets.labels import FixedWidthLabel as FixedWidthLabel
from app.ui.widgets.labels import Separator as Separator
from app.ui.widgets.labels import SteadyLabel as SteadyLabel
from app.ui.widgets.labels import label as label
from app.ui.widgets.labels import set_role as set_role
from app.ui.widgets.lists.scroll_areas import ContentScrollArea as ContentScrollArea
