"""The progress bar of training."""

from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import safe_mean


class SpeedColumn(ProgressColumn):
    """Environment steps per second."""

    def render(self, task: Task) -> Text:
        """Return the speed, or nothing before it is known."""
        return Text(f"{task.speed:,.0f} steps/s" if task.speed else "", style="cyan")


def progress_bar(console: Console, *, visible: bool) -> Progress:
    """Return a progress bar that shows how far, how fast and how well training goes."""
    return Progress(
        SpinnerColumn(),
        TextColumn("[bold]{task.description}"),
        BarColumn(bar_width=None),
        TaskProgressColumn(),
        SpeedColumn(),
        TextColumn("{task.fields[score]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(compact=True),
        console=console,
        disable=not visible,
        expand=True,
    )


class ProgressCallback(BaseCallback):
    """Advance a progress bar with training, and show the latest episodes' return and success.

    Args:
        bar: The bar, started and stopped by the caller.
        description: What is being trained.
    """

    def __init__(self, bar: Progress, description: str) -> None:
        super().__init__()
        self._bar = bar
        self._description = description

    def _on_training_start(self) -> None:
        self._task = self._bar.add_task(
            self._description, total=self.locals["total_timesteps"], score=""
        )

    def _on_rollout_start(self) -> None:
        self._bar.update(self._task, score=self._score())

    def _on_step(self) -> bool:
        self._bar.update(self._task, completed=self.num_timesteps)
        return True

    def _on_training_end(self) -> None:
        self._bar.update(self._task, completed=self.num_timesteps, score=self._score())

    def _score(self) -> str:
        episodes: Any = self.model.ep_info_buffer
        successes: Any = self.model.ep_success_buffer
        if not episodes:
            return ""
        score = f"return [green]{safe_mean([episode['r'] for episode in episodes]):.1f}[/]"
        return f"{score} · success [green]{safe_mean(successes):.0%}[/]" if successes else score
