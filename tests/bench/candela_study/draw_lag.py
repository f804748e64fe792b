"""Figure and tables of the study lag."""
from draw_radii import figure, tables  # noqa: F401

PAPER = ("The paper tests after every iteration in one process. A farm decides once an epoch, from the sums of the epoch "
         "that lies `lag` epochs back, so that no worker waits.")
