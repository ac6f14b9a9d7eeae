"""Types of time spans: rigid windows, flights, and periods in which a force acts."""

# Two ascending times, e.g. tr and td of a rigid window, or the start and end of a force [time].
Times = tuple[float, float]
# Time spans in ascending order [time].
Spans = tuple[Times, ...]
