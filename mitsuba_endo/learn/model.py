"""The decoder network: a small U-Net that works at half resolution."""

from itertools import pairwise

import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor, nn  # pyright: ignore[reportMissingImports]

from ..decoding.network import CHANNELS
from ..decoding.normalise import INPUT_CHANNELS


def _block(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, padding=1, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class DecoderNet(nn.Module):
    """(N, 2, H, W) to (N, 9, H, W), H and W multiples of STRIDE.

    The output's channels are those of ``decode.network``: sine and cosine of the lattice
    coordinates' phases, then logits.

    The first convolution has stride 2 and a 4 x 4 kernel, so that it sees every pixel alike. At the
    end features are enlarged bilinearly and joined with the image itself. There is no transposed
    convolution and no pixel shuffle: OpenCV's network module is slow at one and wrong at the other.
    """

    def __init__(self, widths: tuple[int, ...] = (32, 48, 96, 160), head: int = 24) -> None:
        super().__init__()
        self.stem = nn.Sequential(
            nn.Conv2d(INPUT_CHANNELS, widths[0], 4, stride=2, padding=1, bias=False),
            nn.BatchNorm2d(widths[0]),
            nn.ReLU(inplace=True),
            _block(widths[0], widths[0]),
        )
        pairs = list(pairwise(widths))
        self.down = nn.ModuleList(
            nn.Sequential(nn.MaxPool2d(2), _block(a, b), _block(b, b)) for a, b in pairs
        )
        self.lateral = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in reversed(pairs))
        self.up = nn.ModuleList(_block(2 * a, a) for a, _ in reversed(pairs))
        self.enlarge = nn.Upsample(scale_factor=2, mode="bilinear", align_corners=False)
        self.narrow = nn.Conv2d(widths[0], 16, 1)
        self.head = nn.Sequential(
            nn.Conv2d(16 + INPUT_CHANNELS, head, 3, padding=1),
            nn.ReLU(inplace=True),
            nn.Conv2d(head, len(CHANNELS), 1),
        )

    def forward(self, image: Tensor) -> Tensor:
        features = [self.stem(image)]
        for down in self.down:
            features.append(down(features[-1]))
        x = features.pop()
        for lateral, up in zip(self.lateral, self.up, strict=True):
            x = up(torch.cat([self.enlarge(lateral(x)), features.pop()], 1))
        return self.head(torch.cat([self.enlarge(self.narrow(x)), image], 1))
