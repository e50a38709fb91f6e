from .arrays import (
    Array as Array,
    Bool as Bool,
    Float32 as Float32,
    Float64 as Float64,
    Int64 as Int64,
)
from .checks import (
    check_finite as check_finite,
    check_heights as check_heights,
    check_ids as check_ids,
    check_increasing as check_increasing,
    check_shape as check_shape,
    freeze as freeze,
)
from .errors import (
    ConfigError as ConfigError,
    DownloadError as DownloadError,
    GaiaError as GaiaError,
    InputError as InputError,
    SourceError as SourceError,
)
from .figures import (
    INK as INK,
    SCREEN_DPI as SCREEN_DPI,
    figure_files as figure_files,
    figure_png as figure_png,
    figure_svg as figure_svg,
    house_style as house_style,
    legend_above as legend_above,
    look as look,
    new_figure as new_figure,
    plain_style as plain_style,
)
from .files import (
    OutputFolder as OutputFolder,
    remove_abandoned as remove_abandoned,
    replace_file as replace_file,
    temporary_path as temporary_path,
    visible as visible,
)
from .html import Mark as Mark, sketch as sketch, summary as summary
from .levels import CHI_SQUARE_90 as CHI_SQUARE_90, SIGMAS_90 as SIGMAS_90
from .problems import (
    FAULT as FAULT,
    FAULTS_LOG as FAULTS_LOG,
    Problem as Problem,
    faults_text as faults_text,
    problem_of as problem_of,
)
from .processes import (
    end_with_parent as end_with_parent,
    without_interrupts as without_interrupts,
)
from .reading import (
    name_of as name_of,
    open_regular as open_regular,
    paths_below as paths_below,
    read_regular as read_regular,
)
from .spreadsheet import Cell as Cell, csv_text as csv_text
from .strict_yaml import MAX_BYTES as MAX_BYTES, YamlError as YamlError, read_yaml as read_yaml
from .symmetric import Symmetric as Symmetric
from .text import (
    counted as counted,
    in_a_line as in_a_line,
    in_html as in_html,
    in_markdown as in_markdown,
    metres as metres,
    percent as percent,
    printable as printable,
    shortened as shortened,
    shown as shown,
    some_of as some_of,
    written_out as written_out,
)
