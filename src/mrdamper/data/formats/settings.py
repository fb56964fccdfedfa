"""Limits of the readers: size of files and tables, and how much of a file is searched."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingSettings:
    """Limits of the readers and of the proposal of a channel map. Larger inputs are rejected or cut."""

    # Size of a file
    unpacked_ratio_max: int = 1032  # unpacked size / packed size; deflate cannot reach more
    whole_file_max_bytes: int = 1 << 29  # Larger texts are rejected.
    workbook_unpacked_max_bytes: int = 1 << 29
    archive_unpacked_max_bytes: int = 1 << 31
    folder_depth_max: int = 4  # levels of subfolders that are searched

    # Tables of samples
    table_columns_max: int = 64  # A wider matrix is not a table of channels.
    table_rows_min: int = 10  # A table with fewer rows of numbers contains results, not samples.
    header_lines_max: int = 400  # The first row of a text or a sheet is within these lines.
    element_count_max: int = 4096  # elements of a list or struct array in which signals are searched
    empty_record_columns_min: int = 3  # A single line with this many names is a header without samples.

    # Missing samples inside a channel are interpolated up to these limits.
    missing_ratio_max: float = 0.01
    missing_samples_max: int = 3  # consecutive samples; a longer gap can contain a reversal

    # Limits for the texts that are read from a file
    attribute_lines_max: int = 64
    attribute_length_max: int = 200
    note_lines_max: int = 64
    note_length_max: int = 300
    document_max_bytes: int = 1 << 17
    document_lines_max: int = 2000
    run_list_lines_max: int = 200  # A longer table of numbers is a run, not a list of runs.
    document_line_length_max: int = 4096

    # Time
    continuation_max_steps: float = 1.5  # A piece after a longer pause is a separate recording.
    clock_tolerance_steps: float = 0.01  # Clocks that differ by less than this fraction of a step are equal.
    unix_time_min_s: float = 1e9  # Times between these two limits are seconds since 1970.
    unix_time_max_s: float = 2.2e9  # Larger times are counted from a different day, as in Excel.

    # Shape of a column
    level_part_count: int = 16  # The medians of this number of parts of a column show a step in noise.


SETTINGS = ReadingSettings()
