"""Tests of the translated examples: they compile and run, and files of the user are never translated."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from app import resources
from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.project import Project
from app.core.projects.examples import translated
from app.core.projects.file_format import read_file
from app.core.projects.journal import Journal
from app.core.projects.open_project import OpenProject
from app.core.projects.open_projects import OpenProjects
from app.robots.description.description import parse
from nep import i18n
from tests.blocks.fakes import FakeLink, Play, until
from tests.pseudo import untranslated

EXAMPLES = sorted(resources.path("examples").glob("*.nepb"))
FROM_OUTSIDE = ("robot_pepper_get_", "robot_pepper_do_", "messages_")


@pytest.fixture(scope="module")
def locale(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with all languages, compiled from the current translations."""
    from tools import words

    folder = tmp_path_factory.mktemp("locale")
    shutil.copytree(words.LOCALE_FOLDER, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.mo"))
    words.compile_all(folder)
    return folder


@pytest.fixture
def language(request: pytest.FixtureRequest, locale: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Installed language: the fixture's parameter, or Spanish without one."""
    chosen: str = getattr(request, "param", "es")
    monkeypatch.setattr(i18n, "_current", None)
    i18n.install(chosen, locale)
    assert i18n.language() == chosen
    return chosen


def blocks(value: object, above: str = "") -> Iterator[tuple[Mapping[str, object], str]]:
    """Yield each block in the value with the type of its enclosing block, or "" at the top."""
    if isinstance(value, list):
        for each in value:
            yield from blocks(each, above)
    elif isinstance(value, Mapping):
        kind = str(value.get("type", ""))
        if kind:
            yield value, above
        for name, each in value.items():
            yield from blocks(each, above if name == "next" else kind or above)


def texts(example: Project) -> list[str]:
    found = [
        block for block, _above in blocks(example.always.workspace.blocks) if block["type"] == "values_text"
    ]
    return [str(block["fields"]["TEXT"]) for block in found]  # type: ignore[index]


def names(example: Project) -> list[str]:
    """Return the names of the example's variables and functions."""
    variables = example.always.workspace.blocks.get("variables", [])
    defined = [block["fields"] for block, _above in blocks(example.always.workspace.blocks)
               if str(block["type"]).startswith("functions_define")]  # fmt: skip
    return [*(each["name"] for each in variables), *(fields["NAME"] for fields in defined)]  # type: ignore[attr-defined,index]


@pytest.mark.parametrize("language", ["es", i18n.PSEUDO_LANGUAGE], indirect=True)
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_compiles_in_another_language(path: Path, language: str) -> None:
    english = read_file(path)
    example = translated(english)
    pepper = parse(example.robots["Pepper"])
    program = compile_behaviour(example.always.workspace.blocks, [pepper], name=example.name)
    assert program.problems == ()
    assert program.starts == compile_behaviour(english.always.workspace.blocks, [pepper]).starts
    assert len(set(texts(example))) == len(set(texts(english))), "what differs still differs"
    assert len(set(names(example))) == len(names(english))
    assert example.name != english.name
    assert example.unknown_fields["description"] != english.unknown_fields["description"]
    if language == i18n.PSEUDO_LANGUAGE:
        said = [example.name, str(example.unknown_fields["description"]), *texts(example), *names(example)]
        assert [untranslated(each) for each in said if untranslated(each)] == []


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_translatable_example_texts_are_not_published_or_compared_with_data(path: Path) -> None:
    """The text would be translated, but the programs and data on the other side would not."""
    for block, above in blocks(read_file(path).always.workspace.blocks):
        if block["type"] == "values_text":
            assert not above.startswith("messages_publish"), block
        if block["type"] == "values_compare":
            inside = [each for each, _above in blocks(block.get("inputs"))]
            kinds = [str(each["type"]) for each in inside]
            assert not ("values_text" in kinds and any(each.startswith(FROM_OUTSIDE) for each in kinds)), (
                block
            )


def run(name: str, link: FakeLink) -> Play:
    (path,) = [path for path in EXAMPLES if path.stem == name]
    document = OpenProject(Journal)
    document.open_example(path)
    pepper = parse(document.robots["Pepper"])
    document.set_connected([pepper])
    return Play(document.program(), (pepper,), link).start()


def said(link: FakeLink) -> list[object]:
    return [given["text"] for _, action, given in link.invoked if action == "say"]


@pytest.fixture(autouse=True)
def _home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))


def test_robot_speaks_spanish_in_translated_example(language: str) -> None:
    link = FakeLink()
    link.sensors = {("Pepper", "sees_face"): True, ("Pepper", "distance"): 2.0}
    play = run("1-greeting", link)
    play.end()
    assert play.runtime.error is None
    assert said(link) == ["¡Hola! Soy Pepper.", "Qué gusto verte."]


@pytest.mark.parametrize(("language", "last"), [("es", "Respuestas correctas: 2 de 3"), ("qps", "2")],
                         indirect=["language"])  # fmt: skip
def test_quiz_comparison_works_in_translated_examples(language: str, last: str) -> None:
    link = FakeLink()
    link.sensors[("Pepper", "head_touched")] = True  # always true
    play = run("4-a-quiz", link)
    play.end()
    assert play.runtime.error is None
    assert last in str(said(link)[-1])
    if language == "es":
        assert said(link)[1:4] == [
            "¿El cielo es azul?",
            "¿Los peces andan en bicicleta?",
            "¿El hielo es frío?",
        ]


def test_topics_and_message_fields_are_not_translated(language: str) -> None:
    link = FakeLink()
    play = run("8-weather-station", link)
    until(lambda: bool(link.published))
    topic, message = link.published[0]
    assert (topic, list(message)) == ("/weather", ["temperature"])  # type: ignore[call-overload]
    link.happen("/weather", {"temperature": 25})
    until(lambda: "Hace calor, 25 grados." in said(link))
    play.stop()
    play.end()


def test_user_file_is_never_translated(language: str, tmp_path: Path) -> None:
    own = Path(shutil.copy(EXAMPLES[0], tmp_path / "Greeting.nepb"))
    documents = OpenProjects(lambda: OpenProject(lambda: Journal(tmp_path / "journal")))
    for opened in (documents.open(own), documents.copy(own, "Greeting, before")):
        assert opened.name.startswith("Greeting")
        assert opened.workspace == read_file(own).always.workspace.blocks
    assert documents.open_example(EXAMPLES[0]).name == "Saludo"
    documents.close_all()


def test_translation_keeps_distinct_names_distinct() -> None:
    variables = [{"id": "a", "name": "steps"}, {"id": "b", "name": "moves"}, {"id": "c", "name": "steps"}]
    told = translated(
        Project.of_blocks("x", {"variables": variables}, {}), lambda _context, _english: "pasos"
    )
    assert [each["name"] for each in told.always.workspace.blocks["variables"]] == ["pasos", "moves", "pasos"]  # type: ignore[attr-defined]
