"""Which tr, which td?  From a history in flight to a recommendation, a verdict, and what else to know."""
