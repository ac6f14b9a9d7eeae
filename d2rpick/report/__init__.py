"""Write results as text: a table for people; JSON, CSV and Markdown for programs. This folder prints nothing."""
