"""Adam, by PyTorch's fused kernel alone.

Whoever makes an optimiser of `torch.optim` waits for PyTorch's compiler to be imported, which takes nearly as long as
PyTorch itself and is used for nothing here. The steps are those of `torch.optim.Adam(fused=True)`, bit for bit.
"""

from collections.abc import Iterable

import torch
from torch import Tensor

#: What is kept of each parameter, as PyTorch names it: steps taken, mean of the gradients, mean of their squares.
MOMENTS = ("step", "exp_avg", "exp_avg_sq")
_BETA1, _BETA2, _EPS = 0.9, 0.999, 1e-8


class Adam:
    """Moves parameters against their gradients (Kingma and Ba 2015, with the paper's constants).

    Args:
        parameters: float32, moved in place.
        learning_rate: of each step.

    Attributes:
        moments: of each parameter, by the names in `MOMENTS`; empty before its first step.

    >>> parameter = torch.zeros(2, requires_grad=True)
    >>> adam = Adam([parameter], 0.1)
    >>> parameter.grad = torch.tensor([1.0, -2.0])
    >>> adam.step()
    >>> parameter.detach()
    tensor([-0.1000,  0.1000])
    """

    def __init__(self, parameters: Iterable[Tensor], learning_rate: float) -> None:
        self._parameters = list(parameters)
        self._learning_rate = learning_rate
        self.moments: list[dict[str, Tensor]]
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.moments = [{} for _ in self._parameters]

    def zero_grad(self) -> None:
        """Let the gradients go."""
        for parameter in self._parameters:
            parameter.grad = None

    @torch.no_grad()
    def step(self) -> None:
        """One step; every parameter must have a gradient."""
        gradients = [parameter.grad for parameter in self._parameters if parameter.grad is not None]
        for parameter, moments in zip(self._parameters, self.moments, strict=True):
            if not moments:
                fresh = torch.zeros(()), torch.zeros_like(parameter), torch.zeros_like(parameter)
                moments.update(zip(MOMENTS, fresh, strict=True))
        steps, means, squares = ([moments[name] for moments in self.moments] for name in MOMENTS)
        torch._foreach_add_(steps, 1)  # pyright: ignore[reportPrivateUsage, reportPrivateImportUsage]
        torch._fused_adam_(  # pyright: ignore[reportPrivateUsage, reportPrivateImportUsage]
            self._parameters,
            gradients,
            means,
            squares,
            [],
            steps,
            lr=self._learning_rate,
            beta1=_BETA1,
            beta2=_BETA2,
            weight_decay=0.0,
            eps=_EPS,
            amsgrad=False,
            maximize=False,
        )
