"""What can go wrong, in one line each: where, what was found, what was expected, what to do."""


class D2RPickError(Exception):
    """Root of all errors of d2rpick; its text is one line, ready to be shown to a user."""


class FormatError(D2RPickError):
    """A file cannot be read as an energy history."""


class HistoryError(D2RPickError):
    """Numbers were read, but they do not make an energy history."""


class RangeError(D2RPickError):
    """A time or a parameter lies outside what the history or the mechanics allow."""


class DeckError(D2RPickError):
    """A deck cannot be read, or a card cannot be written."""


class ConfigurationError(D2RPickError):
    """The configuration of the deck check is wrong: an unknown rule, key or severity."""
