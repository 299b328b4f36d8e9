from patrol.errors import BadInput


def test_an_error_is_one_line_whatever_it_quotes() -> None:
    assert str(BadInput("yards.yaml: name = 'a\nb\r\nc': no")) == "yards.yaml: name = 'a b c': no"
