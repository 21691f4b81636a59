"""Names of joints as nobody would choose them, but a file can have them."""

from xml.sax.saxutils import quoteattr

FRAME = "<iframe srcdoc=\"<script>parent.document.title='OWNED'</script>\"></iframe>"
NAMES = [
    # C: line splicing and trigraphs end comments; quotes and escapes end strings.
    *(
        "j*\\\n/\nint spliced = 1;\n/*",
        "*??/\n/ int trigraph = 1; /*",
        '"; int quoted; "',
        "\\",
    ),
    *("\\x41??/", "end\\\n", "%s%n{0}{name}", "#include <x>"),
    # HTML and Markdown.
    *(FRAME, "<script>alert(1)</script>", "&lt;b&gt;&amp;", "</td></tr></table>", "<!--"),
    *("![x](http://a/b)", "[x](javascript:alert(1))", "`a`|**b**|__c__", "| | |", "# 1. - > +"),
    *("{alert(1)}", "~~x~~", "*", "_x_"),
    # LaTeX and mathtext.
    *("$x_$", "$\\frac{1}$", "\\input{x}%#&^~_{}", "a_b^c", "\\$"),
    # Formulas in spreadsheets, and what CSV has for its own.
    *("=cmd|'/c calc'!A0", "+1+1", "-1+1", "@SUM(1)", "  =1+1", "\t=1", "\r=1", "＝1+1"),
    *('a,b;"c"', "x\ny", "'"),
    # YAML, JSON and URDF.
    *("null", "true", "1e-7", "0x1", "- a: b", "? ", "!!python/object:x", "\\u0041"),
    *("\\ud83d\\ude00", "]]>", "&#10;", "a='b'"),
    # Addresses on the command line, paths, terminals, other scripts.
    *("a=b", "x:y", "../../etc", "é漢字", "\U0001f600", "\u202ebackwards", "a\u2028b"),
    *("\x7f\x9b31m", "\ufffd", "long" * 80),
]


def in_urdf(text, names):
    """The URDF text of `made_robots` with other names for its joints j0, j1, …"""
    for k, name in enumerate(names):
        text = text.replace(f'joint name="j{k}"', f"joint name={quoted(name)}")
    return text


def quoted(name):
    """An attribute's value in XML, which would have blanks for line ends and tabs."""
    return quoteattr(name, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})
