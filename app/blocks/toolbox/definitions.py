"""Block definitions and toolbox of the editor, in Blockly's JSON format."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from app.blocks.model.category import Category, Group, ToolboxEntry
from app.blocks.toolbox.catalogue import Catalogue, categories
from app.blocks.toolbox.help import help_of
from app.robots.description.description import Robot
from nep.i18n import _, translate

STYLES = ("events", "control", "values", "variables", "functions", "messages", "robot", "sensors")


def editor_definitions(
    robots: Sequence[Robot], absent: Sequence[Robot] = (), topics: Sequence[str] = ()
) -> dict[str, object]:
    """Return everything that the editor needs as a JSON object.

    The members are ``blocks`` (block definitions), ``help`` (see `help_of`) by block type, ``toolbox``,
    ``styles`` (names of the block styles), and the options of the drop-downs for ``robots`` and ``topics``.

    Args:
        robots: Connected robots.
        absent: Disconnected robots, whose blocks are included but can't run.
        topics: Names of the existing topics.
    """
    catalogue = Catalogue(robots, absent)
    return {
        "blocks": [block.to_blockly() for block in catalogue.blocks.values()],
        "help": {block.type: help_of(block) for block in catalogue.blocks.values()},
        "toolbox": _toolbox(catalogue),
        "styles": list(STYLES),
        "robots": {
            robot.name: {"model": robot.model, "connected": robot.name in catalogue.connected}
            for robot in (*catalogue.connected.values(), *catalogue.absent.values())
        },
        "topics": list(topics),
    }


def _toolbox(catalogue: Catalogue) -> dict[str, object]:
    contents: list[Mapping[str, object]] = [{"kind": "blocksHeading", "name": _("Blocks")}]
    all_robots = (*catalogue.connected.values(), *catalogue.absent.values())
    groups = {
        robot.name: [
            group
            for category in categories()
            for group in (category.make_groups(robot, all_robots) if category.make_groups else ())
        ]
        for robot in catalogue.connected.values()
    }
    contents += [_category(each, groups) for each in categories() if each.blocks and not each.parent]
    for robot in catalogue.connected.values():
        contents.append(_heading(robot, is_connected=True))
        contents += [_group(robot, group) for group in groups[robot.name]]
    contents += [_heading(robot, is_connected=False) for robot in catalogue.absent.values()]
    return {"kind": "categoryToolbox", "contents": contents}


def _heading(robot: Robot, *, is_connected: bool) -> dict[str, object]:
    return {"kind": "robotHeading", "name": robot.name, "virtual": robot.virtual, "connected": is_connected}


def _category(category: Category, groups: Mapping[str, Sequence[Group]]) -> dict[str, object]:
    contents: list[Mapping[str, object]] = []
    if category.button is not None:
        button_text, key = category.button
        contents.append({"kind": "button", "text": button_text, "callbackkey": key})
    parts = [each for each in categories() if category.name in (each.name, each.parent)]
    for part in parts:
        if part is not category:
            contents.append({"kind": "label", "text": part.title})
        contents += _category_contents(part)
    if any(block.shape == "hat" for block in category.blocks):
        contents += _robot_hats(groups)
    entry = _entry(category.name, category.title, category.style, category.icon, contents)
    return entry | {"dynamic": category.dynamic} if category.dynamic else entry


def _category_contents(category: Category) -> Iterator[Mapping[str, object]]:
    for block in category.blocks:
        if block.type in category.headings:
            yield {"kind": "label", "text": category.headings[block.type]}
        if block.is_in_toolbox:
            yield block.to_toolbox()


def _robot_hats(groups: Mapping[str, Sequence[Group]]) -> list[Mapping[str, object]]:
    contents: list[Mapping[str, object]] = []
    for robot, robot_groups in groups.items():
        hats = [
            _block(entry) for group in robot_groups for entry in group.entries if entry.block.shape == "hat"
        ]
        if hats:
            contents += [{"kind": "label", "text": robot}, *hats]
    return contents


def _group(robot: Robot, group: Group) -> dict[str, object]:
    contents = [_block(entry) for entry in group.entries]
    title = translate("category", group.title)
    definition = _entry(f"{robot.name}: {group.title}", title, group.style, group.icon, contents)
    return definition | {"robot": robot.name}


def _block(entry: ToolboxEntry) -> Mapping[str, object]:
    return entry.block.to_toolbox(entry.fields)


def _entry(
    id: str, title: str, style: str, icon: str, contents: Sequence[Mapping[str, object]]
) -> dict[str, object]:
    return {
        "kind": "category",
        "toolboxitemid": id,
        "name": title,
        "categorystyle": style,
        "icon": icon,
        "contents": list(contents),
    }
