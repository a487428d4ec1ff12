//! Numbers as C programs print them.

/// `value` with so many significant digits, as C's `%g` prints it.
pub(crate) fn general(value: f64, digits: u8) -> String {
    let digits = i32::from(digits.max(1));
    if !value.is_finite() {
        let name = if value.is_nan() { "nan" } else { "inf" };
        return if value.is_sign_negative() { format!("-{name}") } else { name.into() };
    }
    let scientific = format!("{value:.*e}", digits as usize - 1);
    let Some((mantissa, exponent)) = scientific.split_once('e') else { return scientific };
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if (-4..digits).contains(&exponent) {
        trim(&format!("{value:.*}", (digits - 1 - exponent) as usize)).to_owned()
    } else {
        let sign = if exponent < 0 { '-' } else { '+' };
        format!("{}e{sign}{:02}", trim(mantissa), exponent.abs())
    }
}

/// Without the zeros that end a decimal fraction.
fn trim(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_printed_as_c_prints_them() {
        let cases = [
            (0.0, "0"),
            (-0.0, "-0"),
            (1.0, "1"),
            (-3.75, "-3.75"),
            (100_000.0, "100000"),
            (1_000_000.0, "1e+06"),
            (999_999.5, "1e+06"),
            (123_456.7, "123457"),
            (0.000_1, "0.0001"),
            (0.000_012_345_678, "1.23457e-05"),
            (1.0 / 3.0, "0.333333"),
            (-1e-100, "-1e-100"),
            (f64::INFINITY, "inf"),
        ];
        for (value, expected) in cases {
            assert_eq!(general(value, 6), expected);
        }
        assert_eq!(general(1000.0 / 3.0, 17), "333.33333333333331");
        assert_eq!(general(0.3155, 17), "0.3155");
    }
}
