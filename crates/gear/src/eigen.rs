//! Eigenvalues and eigenvectors of a small symmetric matrix.
//!
//! Householder reduction to tridiagonal form, then implicit QL steps (the classic `tred2` and
//! `tql2`): O(n³), no tuning, and the same bits whatever vector units the machine has, which
//! matters because random samples are compared by digest.
//!
//! Reference: B. S. Garbow et al., *Matrix Eigensystem Routines — EISPACK Guide Extension*,
//! Springer 1977.

/// QL steps at most for one eigenvalue; two are usual.
const MAX_STEPS: usize = 60;

/// Eigenvalues of the symmetric `n` × `n` matrix `a` (row by row), decreasing, each with its
/// normalised eigenvector.
pub(crate) fn symmetric(a: Vec<f64>, n: usize) -> Vec<(f64, Vec<f64>)> {
    let mut v: Vec<Vec<f64>> = a.chunks_exact(n).map(<[f64]>::to_vec).collect();
    let (mut d, mut e) = tridiagonal(&mut v);
    let mut vectors: Vec<Vec<f64>> = (0..n)
        .map(|k| v.iter().map(|row| row[k]).collect())
        .collect();
    diagonal(&mut vectors, &mut d, &mut e);
    let mut pairs: Vec<(f64, Vec<f64>)> = d.into_iter().zip(vectors).collect();
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    pairs
}

/// Householder reduction. `v` becomes the orthogonal transformation; returns diagonal and
/// subdiagonal, the latter from index 1.
fn tridiagonal(v: &mut [Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
    let n = v.len();
    let mut e = vec![0.0; n];
    let mut d = v[n - 1].clone();
    for i in (1..n).rev() {
        let scale: f64 = d[..i].iter().map(|x| x.abs()).sum();
        let mut h = 0.0;
        if scale == 0.0 {
            e[i] = d[i - 1];
            for j in 0..i {
                d[j] = v[i - 1][j];
                v[i][j] = 0.0;
                v[j][i] = 0.0;
            }
        } else {
            for x in &mut d[..i] {
                *x /= scale;
                h += *x * *x;
            }
            let f = d[i - 1];
            let g = if f > 0.0 { -h.sqrt() } else { h.sqrt() };
            e[i] = scale * g;
            h -= f * g;
            d[i - 1] = f - g;
            e[..i].fill(0.0);
            for j in 0..i {
                let f = d[j];
                v[j][i] = f;
                let mut g = e[j] + v[j][j] * f;
                for k in j + 1..i {
                    g += v[k][j] * d[k];
                    e[k] += v[k][j] * f;
                }
                e[j] = g;
            }
            let mut f = 0.0;
            for j in 0..i {
                e[j] /= h;
                f += e[j] * d[j];
            }
            let half = f / (h + h);
            for j in 0..i {
                e[j] -= half * d[j];
            }
            for j in 0..i {
                let (f, g) = (d[j], e[j]);
                for k in j..i {
                    v[k][j] -= f * e[k] + g * d[k];
                }
                d[j] = v[i - 1][j];
                v[i][j] = 0.0;
            }
        }
        d[i] = h;
    }
    for i in 0..n - 1 {
        v[n - 1][i] = v[i][i];
        v[i][i] = 1.0;
        let h = d[i + 1];
        if h != 0.0 {
            for k in 0..=i {
                d[k] = v[k][i + 1] / h;
            }
            for j in 0..=i {
                let g: f64 = (0..=i).map(|k| v[k][i + 1] * v[k][j]).sum();
                for k in 0..=i {
                    v[k][j] -= g * d[k];
                }
            }
        }
        for row in &mut v[..=i] {
            row[i + 1] = 0.0;
        }
    }
    d.clone_from(&v[n - 1]);
    v[n - 1].fill(0.0);
    v[n - 1][n - 1] = 1.0;
    (d, e)
}

/// Implicit QL iteration on the tridiagonal matrix; `d` becomes the eigenvalues and `vectors`, the
/// columns of the transformation, the eigenvectors.
fn diagonal(vectors: &mut [Vec<f64>], d: &mut [f64], e: &mut [f64]) {
    let n = d.len();
    e.rotate_left(1);
    e[n - 1] = 0.0;
    let (mut f, mut largest) = (0.0, 0.0_f64);
    for l in 0..n {
        largest = largest.max(d[l].abs() + e[l].abs());
        let mut m = l;
        while m + 1 < n && e[m].abs() > f64::EPSILON * largest {
            m += 1;
        }
        if m > l {
            for _ in 0..MAX_STEPS {
                let g = d[l];
                let p = (d[l + 1] - g) / (2.0 * e[l]);
                let r = if p < 0.0 { -p.hypot(1.0) } else { p.hypot(1.0) };
                d[l] = e[l] / (p + r);
                d[l + 1] = e[l] * (p + r);
                let next = d[l + 1];
                let h = g - d[l];
                for x in &mut d[l + 2..] {
                    *x -= h;
                }
                f += h;
                let mut p = d[m];
                let (mut c, mut c2, mut c3) = (1.0, 1.0, 1.0);
                let (mut s, mut s2) = (0.0, 0.0);
                let after = e[l + 1];
                for i in (l..m).rev() {
                    c3 = c2;
                    c2 = c;
                    s2 = s;
                    let g = c * e[i];
                    let h = c * p;
                    let r = p.hypot(e[i]);
                    e[i + 1] = s * r;
                    s = e[i] / r;
                    c = p / r;
                    p = c * d[i] - s * g;
                    d[i + 1] = h + s * (c * g + s * d[i]);
                    let (left, right) = vectors.split_at_mut(i + 1);
                    for (a, b) in left[i].iter_mut().zip(&mut right[0]) {
                        (*a, *b) = (c * *a - s * *b, s * *a + c * *b);
                    }
                }
                p = -s * s2 * c3 * after * e[l] / next;
                e[l] = s * p;
                d[l] = c * p;
                // Also ends on a NaN, which then shows in the eigenvalues.
                let large = e[l].abs() > f64::EPSILON * largest;
                if !large {
                    break;
                }
            }
        }
        d[l] += f;
        e[l] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::symmetric;

    /// The second-difference matrix has the eigenvalues 2 − 2 cos(kπ/(n + 1)).
    #[test]
    fn second_differences() {
        for n in [1, 2, 3, 17, 64] {
            let mut a = vec![0.0; n * n];
            for i in 0..n {
                a[i * n + i] = 2.0;
                if i + 1 < n {
                    a[i * n + i + 1] = -1.0;
                    a[(i + 1) * n + i] = -1.0;
                }
            }
            for (k, (value, _)) in symmetric(a, n).iter().rev().enumerate() {
                let angle = (k + 1) as f64 * std::f64::consts::PI / (n + 1) as f64;
                assert!((value - (2.0 - 2.0 * angle.cos())).abs() < 1e-13);
            }
        }
    }

    /// A = V Λ Vᵀ with orthonormal V, for a full matrix with eigenvalues over twelve decades, a
    /// repeated one and a zero row.
    #[test]
    fn reconstructs_the_matrix() {
        let n = 20;
        let mut a = vec![0.0; n * n];
        for i in 0..n - 1 {
            for j in 0..n - 1 {
                let h = (i as f64 - j as f64) / 6.0;
                a[i * n + j] = (-h * h).exp();
            }
        }
        let pairs = symmetric(a.clone(), n);
        assert!(pairs.windows(2).all(|w| w[0].0 >= w[1].0));
        for i in 0..n {
            for j in 0..n {
                let sum: f64 = pairs.iter().map(|(l, v)| l * v[i] * v[j]).sum();
                assert!((sum - a[i * n + j]).abs() < 1e-13);
                let dot: f64 = pairs[i].1.iter().zip(&pairs[j].1).map(|(a, b)| a * b).sum();
                assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-13);
            }
        }
    }
}
