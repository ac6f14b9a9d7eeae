"""Results as text: a table for people, JSON, CSV and Markdown for everything else.  Nothing here prints."""
