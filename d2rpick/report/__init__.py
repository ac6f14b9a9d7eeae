"""Write results as text: a table for people; JSON, CSV and Markdown for programs. Nothing in this folder prints."""
