"""Driver: connection of a robot to the network, with its topics, commands and watchdog.

The robot's ``async def`` actions share one event loop (`EventLoop`), to which their connections belong.
"""

from __future__ import annotations

import asyncio
import inspect
import json
import logging
import threading
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import nep
from app.clock import MonotonicClock, ThreadClock
from app.errors import DescriptionError, RobotValueError
from app.robots.description.description import MAX_BYTES, parse, thing_description, topic_of
from app.robots.description.inputs import input_problems
from app.robots.description.json_access import as_object
from app.robots.driver.call import Call, Canceled
from app.robots.driver.commands import CommandHandler
from app.robots.driver.declare import Kind
from app.robots.driver.dispatcher import Dispatcher
from app.robots.driver.receiver import CommandReceiver, MessageQueue, RejectedMessages
from app.robots.driver.rize_dialect import RizeDialect
from app.robots.driver.schema_values import fields_to_json
from app.robots.driver.tasks import Tasks
from nep.i18n import _, lazy, number
from nep.text import quotable

if TYPE_CHECKING:
    from typing_extensions import Self

RIZE_COMMANDS, RIZE_ANSWERS, RIZE_EVENTS = "robot_action", "action_state", "rize_event"
BLACKBOARD_TOPIC = "/blackboard"
MAX_WORLD_BYTES = 1_000_000
_CLOSE_TIMEOUT_S, _JOIN_TIMEOUT_S = 2.0, 2.0
_log = logging.getLogger(__name__)


class Driver:
    """Driver of one robot, and the implementation of `Link`. Thread-safe.

    Closing the driver closes its publishers and subscribers, but not the node, which belongs to the
    caller. Usable as a context manager.

    Args:
        kind: Kind of the robot.
        name: Name of the robot, which is the first level of its topics.
        node: Node for publishers and subscribers.
        clock: Clock of the waits and threads of the driver and its robot (default: that of the computer).

    Raises:
        DescriptionError: The name is invalid, or the description is too large.
    """

    def __init__(self, kind: Kind, name: str, node: nep.Node, *, clock: ThreadClock | None = None) -> None:
        self.name = name
        self.kind = kind
        self.description = thing_description(kind.thing_model, name)
        self.robot = parse(self.description)
        if len(json.dumps(self.description)) > MAX_BYTES:
            raise DescriptionError(
                name,
                (_("it exceeds the limit of {limit} MB").format(limit=number(MAX_BYTES / 1000000.0, ".0f")),),
            )
        self._node = node
        self.clock: ThreadClock = clock or MonotonicClock()
        self._lock = threading.Lock()
        self._publishers: dict[str, nep.Publisher] = {}
        self._subscribers: list[nep.Subscriber] = []
        self._body: object = None
        self._tasks: Tasks | None = None
        self._rejected = RejectedMessages(name)
        self._world_dispatcher: Dispatcher | None = None
        self._loop = EventLoop(name)

    @property
    def body(self) -> object:
        """Instance of the robot's class while the driver is running, else None."""
        return self._body

    # ---- start and close -----------------------------------------------------------------------------------

    def start(self) -> None:
        """Open the topics, create the instance of the robot's class, and publish the description.

        Raises `MasterUnreachable` or another `NepError` if the network can't be used; `start` can be called
        again afterwards.
        """
        try:
            self._create_topics()
            self._body = self.kind.body(self)
            self._start_commands(self._body)
            self._open_publisher(self.robot.topics.description, "robot/description", latched=True)
        except nep.NepError:
            self.close()
            raise
        self._publish(self.robot.topics.description, self.description)
        self._publish(RIZE_EVENTS, {"robot": "ready", "name": self.name})

    def _create_topics(self) -> None:
        for name, spec in self.kind.sensors.items():
            msg_type = "image" if spec.is_image else "json"
            self._open_publisher(topic_of(self.name, name), msg_type, latched=not spec.is_image)
        for name in self.kind.events:
            self._open_publisher(topic_of(self.name, name))
        self._open_publisher(self.robot.topics.reply, "robot/answer")
        self._open_publisher(RIZE_ANSWERS)
        self._open_publisher(RIZE_EVENTS, latched=True)
        if any(spec.to_rize for spec in self.kind.events.values()):
            self._open_publisher(BLACKBOARD_TOPIC)

    def _start_commands(self, body: object) -> None:
        stop, timing = self.kind.stop
        stop_function: Callable[[], object] = getattr(body, stop)
        publish_reply = partial(self._publish, self.robot.topics.reply)

        def publish_heartbeat(not_ended: tuple[str, ...], error: str | None) -> None:
            handler.publish_heartbeat(
                not_ended, error, rejected=self._rejected.count
            )  # created with the tasks below

        self._tasks = tasks = Tasks(
            self.name,
            lambda: self._resolve(stop_function()),
            self.clock,
            within_s=timing.within_s,
            watchdog_s=timing.watchdog_s,
            send_heartbeat=publish_heartbeat,
        )
        handler = CommandHandler(self.robot, body, self.kind.actions, tasks, publish_reply, self._resolve)
        dialect = RizeDialect(
            self.robot, self.kind.actions, handler, tasks, partial(self._publish, RIZE_ANSWERS)
        )
        tasks.start()
        topic, stop_words = self.robot.topics.command, ("stop", stop)
        native_receiver = CommandReceiver(topic, tasks, handler, stop_words, self._rejected)
        rize_receiver = CommandReceiver(
            RIZE_COMMANDS, tasks, dialect, stop_words, self._rejected, queues_stops=True
        )
        self._subscribers.append(self._node.new_sub(topic, "robot/command", sink=native_receiver.process))
        self._subscribers.append(self._node.new_sub(RIZE_COMMANDS, "json", sink=rize_receiver.process))

    def close(self) -> None:
        """Stop the robot, reply to pending commands, stop the threads and close the topics. Idempotent."""
        for subscriber in self._subscribers:
            subscriber.close()
        self._subscribers.clear()
        dispatcher, self._world_dispatcher = self._world_dispatcher, None
        if dispatcher is not None:
            dispatcher.close()
        tasks, self._tasks = self._tasks, None
        if tasks is not None:
            tasks.close()
        close, self._body = getattr(self._body, "close", None), None
        if callable(close):
            try:
                self._resolve(close(), within_s=_CLOSE_TIMEOUT_S)
            except Exception:  # noqa: BLE001 - everything else must be closed in any case
                _log.warning("%s: close() raised an exception", self.name, exc_info=True)
        self._loop.close()
        self._loop = EventLoop(self.name)
        with self._lock:
            publishers, self._publishers = list(self._publishers.values()), {}
        for publisher in publishers:
            publisher.close()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    # ---- publishing ---------------------------------------------------------------------

    def sense(self, sensor: str, value: object) -> None:
        """Publish the value of a sensor.

        Raises:
            KeyError: The kind has no such sensor.
            RobotValueError: The value has a wrong type.
        """
        spec = self.kind.sensors[sensor]
        try:
            encoded = spec.to_json(value)
        except RobotValueError as error:
            message = lazy("{robot}'s sensor '{sensor}': {error}")
            raise RobotValueError(message, robot=self.name, sensor=sensor, error=error) from error
        self._publish(topic_of(self.name, sensor), encoded)

    def happen(self, event: str, **data: object) -> None:
        """Publish an event; if it can be converted, also on RIZE's blackboard.

        Raises:
            KeyError: The kind has no such event.
            RobotValueError: A field has a wrong type.
        """
        spec = self.kind.events[event]
        try:
            data = fields_to_json(spec.fields, data)
        except RobotValueError as error:
            message = lazy("{robot}'s event '{event}': {error}")
            raise RobotValueError(message, robot=self.name, event=event, error=error) from error
        self._publish(topic_of(self.name, event), data)
        if spec.to_rize is not None:
            primitive, rize_input = spec.to_rize(data)
            self._publish(
                BLACKBOARD_TOPIC, {"primitive": primitive, "input": dict(rize_input), "robot": self.name}
            )

    def event_problems(self, event: str, data: Mapping[str, object]) -> Sequence[str]:
        """Validate the data of an event; return one sentence per problem, empty if the data are valid.

        Every described field must be present with a valid value; other fields are not allowed.
        """
        event_description = self.robot.event(event)
        if event_description is None:
            return (_("{robot} has no event “{event}”").format(robot=self.name, event=quotable(event)),)
        missing = [field for field in event_description.fields if field.name not in data]
        return (
            *(problem.message for problem in input_problems(event_description.fields, data)),
            *(_("{place} is missing").format(place=field.title) for field in missing),
        )

    def publish_value(self, leaf: str, value: object) -> None:
        """Publish a value on a topic that is not in the description; see `Link.publish_value`."""
        topic = topic_of(self.name, leaf)
        if topic not in self._publishers:
            self._open_publisher(topic)
        self._publish(topic, value)

    def subscriber_count(self, leaf: str) -> int:
        """Return the number of subscribers of a topic of the robot; 0 if the topic isn't open.

        Args:
            leaf: Last level of the topic, such as the name of a sensor.
        """
        publisher = self._publishers.get(topic_of(self.name, leaf))
        return 0 if publisher is None else publisher.subscribers

    def run(self, awaitable: Awaitable[object]) -> object:
        """Run an awaitable in the robot's event loop and wait for the result.

        The robot's ``async def`` actions run in the same event loop.
        """
        return self._loop.run(awaitable)

    def on_world(self, changed: Callable[[Mapping[str, object]], None]) -> None:
        """Call ``changed`` with the payload of each message on ``/<name>/world``, in a background thread.

        The name of the thread is ``<name> world``.
        """
        self._subscribe(topic_of(self.name, "world"), changed)

    def open_shared_topic(
        self, topic: str, changed: Callable[[Mapping[str, object]], None], *, latched: bool = False
    ) -> Callable[[Mapping[str, object]], None]:
        """Publish and subscribe to a topic that several robots share.

        Args:
            topic: Name of the topic.
            changed: Called with the payload of each message, in the same thread as for `on_world`.
            latched: True to keep the last message for later subscribers.

        Returns:
            Function that publishes a message, and does nothing after `close`.
        """
        self._open_publisher(topic, latched=latched)
        self._subscribe(topic, changed)
        return partial(self._publish, topic)

    def _resolve(self, result: object, call: Call | None = None, *, within_s: float | None = None) -> object:
        return self._loop.run(result, call, within_s=within_s) if inspect.isawaitable(result) else result

    # ---- topics -----------------------------------------------------------------------------------

    def _open_publisher(self, topic: str, msg_type: str = "json", *, latched: bool = False) -> None:
        publisher = self._node.new_pub(topic, msg_type, latched=latched)
        with self._lock:
            self._publishers[topic] = publisher

    def _publish(self, topic: str, value: object) -> None:
        publisher = self._publishers.get(topic)
        if publisher is None:
            return  # closed in the meantime
        try:
            publisher.publish(value)
        except nep.ClosedError:
            return

    def _subscribe(self, topic: str, changed: Callable[[Mapping[str, object]], None]) -> None:
        # In a separate thread: handling a message must not delay a stop.
        if self._world_dispatcher is None:
            self._world_dispatcher = Dispatcher(f"{self.name} world", self.clock)
            self._world_dispatcher.start()
        queue = MessageQueue(topic, self._world_dispatcher.post, self._rejected, MAX_WORLD_BYTES)

        def enqueue(messages: Sequence[nep.Message]) -> None:
            for message in messages:
                queue.put(message, lambda payload: changed(as_object(payload)))

        self._subscribers.append(self._node.new_sub(topic, "json", sink=enqueue))


class EventLoop:
    """Asyncio event loop in a background thread, which is started with the first awaitable. Thread-safe.

    All awaitables of a robot share the loop, so that one action can use a connection opened by another.

    Args:
        name: Name of the robot.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._is_closed = False

    def run(
        self, awaitable: Awaitable[object], call: Call | None = None, *, within_s: float | None = None
    ) -> object:
        """Run an awaitable in the loop and wait for it; return its result or raise its exception.

        Args:
            awaitable: Awaitable.
            call: Call whose cancellation cancels the awaitable; None if it can't be cancelled.
            within_s: Timeout in seconds, after which the awaitable is cancelled; None for no limit.

        Raises:
            Canceled: The call was cancelled.
            TimeoutError: The timeout has elapsed.
            RuntimeError: The loop is closed, or the caller runs in the loop.
        """
        loop, pending = self._running_loop(awaitable), _PendingAwaitable(awaitable)
        self._call_soon(partial(pending.start, loop, f"{self._name}: {call.action if call else 'run'}"))
        if call is not None:
            call.on_cancel(partial(self._call_soon, pending.cancel))
        if not pending.ended.wait(within_s) and within_s is not None:
            self._call_soon(pending.cancel)
            raise TimeoutError(_("timed out after {seconds} s").format(seconds=number(within_s)))
        if pending.error is not None:
            raise pending.error
        return pending.result

    def close(self) -> None:
        """Cancel running coroutines and stop the thread; a blocked loop is abandoned with a warning."""
        with self._lock:
            self._is_closed = True
            loop, thread = self._loop, self._thread
        if loop is None or thread is None:
            return
        self._call_soon(loop.stop)
        thread.join(_JOIN_TIMEOUT_S)
        if thread.is_alive():
            _log.warning("%s: an async function blocks the event loop; its thread was abandoned", self._name)

    def _running_loop(self, awaitable: Awaitable[object]) -> asyncio.AbstractEventLoop:
        with self._lock:
            if self._is_closed or threading.current_thread() is self._thread:
                if asyncio.iscoroutine(awaitable):
                    awaitable.close()
                if self._is_closed:
                    raise RuntimeError(_("can't run the coroutine: the robot's driver is closed"))
                raise RuntimeError(_("can't block in the event loop; use await"))
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                name = f"{self._name} asyncio"
                self._thread = threading.Thread(
                    target=_run_loop, args=(self._loop, lambda: self._is_closed), name=name, daemon=True
                )
                self._thread.start()
            return self._loop

    def _call_soon(self, callback: Callable[[], object]) -> None:
        loop = self._loop
        try:
            if loop is not None:
                loop.call_soon_threadsafe(callback)
        except RuntimeError:  # the loop has ended
            return


class _PendingAwaitable:
    """Awaitable that another thread waits for.

    Until `ended` is set, its other attributes belong to the loop's thread.
    """

    def __init__(self, awaitable: Awaitable[object]) -> None:
        self.ended = threading.Event()
        self.result: object = None
        self.error: BaseException | None = Canceled()
        self._awaitable = awaitable
        self._task: asyncio.Task[None] | None = None

    def start(self, loop: asyncio.AbstractEventLoop, name: str) -> None:
        self._task = loop.create_task(self._run(), name=name)
        self._task.add_done_callback(self._finish)

    def cancel(self) -> None:
        if self._task is not None:
            self._task.cancel()

    async def _run(self) -> None:
        # Exceptions are stored: a SystemExit that leaves a task would end the loop.
        try:
            self.result = await self._awaitable
            self.error = None
        except asyncio.CancelledError:
            return
        except BaseException as error:  # noqa: BLE001 - raised again in the waiting thread
            self.error = error

    def _finish(self, _task: object) -> None:
        if asyncio.iscoroutine(self._awaitable):
            self._awaitable.close()  # canceled before its first step: avoid a "never awaited" warning
        self.ended.set()


def _run_loop(loop: asyncio.AbstractEventLoop, is_closed: Callable[[], bool]) -> None:
    asyncio.set_event_loop(loop)
    try:
        while not is_closed():
            try:
                loop.run_forever()
            except BaseException:  # noqa: BLE001 - e.g. SystemExit of a driver's task; an async stop needs the loop
                _log.error("a coroutine ended the event loop; restarting the event loop", exc_info=True)
        remaining = asyncio.all_tasks(loop)
        for task in remaining:
            task.cancel()
        if remaining:
            loop.run_until_complete(asyncio.wait(remaining, timeout=_JOIN_TIMEOUT_S / 2))
        loop.run_until_complete(loop.shutdown_asyncgens())
    finally:
        asyncio.set_event_loop(None)
        loop.close()
