"use strict";

/**
 * Adds a product of matrices: out [rows, columns] += x [rows, inner] · w [inner, columns].
 *
 * `rowStride` and `innerStride` are the distances of the elements of x, so that x may be a transposed
 * matrix. A block of two rows and four columns is summed in eight variables, because the plain loops
 * spend most of their time on reading and writing `out`.
 */
function addProduct(out, x, rowStride, innerStride, w, rows, inner, columns) {
  let column = 0;
  for (; column + 4 <= columns; column += 4) {
    for (let row = 0; row < rows; row += 2) {
      const step = row + 1 < rows ? 1 : 0; // 0: an odd last row is computed twice
      const a = row * columns + column;
      const b = a + step * columns;
      const next = step * rowStride;
      let a0 = out[a];
      let a1 = out[a + 1];
      let a2 = out[a + 2];
      let a3 = out[a + 3];
      let b0 = out[b];
      let b1 = out[b + 1];
      let b2 = out[b + 2];
      let b3 = out[b + 3];
      for (let i = 0, j = row * rowStride, k = column; i < inner; i++, j += innerStride, k += columns) {
        const u = x[j];
        const v = x[j + next];
        const w0 = w[k];
        const w1 = w[k + 1];
        const w2 = w[k + 2];
        const w3 = w[k + 3];
        a0 += u * w0;
        a1 += u * w1;
        a2 += u * w2;
        a3 += u * w3;
        b0 += v * w0;
        b1 += v * w1;
        b2 += v * w2;
        b3 += v * w3;
      }
      out[a] = a0;
      out[a + 1] = a1;
      out[a + 2] = a2;
      out[a + 3] = a3;
      out[b] = b0;
      out[b + 1] = b1;
      out[b + 2] = b2;
      out[b + 3] = b3;
    }
  }
  for (; column < columns; column++) {
    for (let row = 0; row < rows; row++) {
      let sum = out[row * columns + column];
      for (let i = 0, j = row * rowStride, k = column; i < inner; i++, j += innerStride, k += columns) {
        sum += x[j] * w[k];
      }
      out[row * columns + column] = sum;
    }
  }
}

/** Writes the transposed matrix [columns, rows] of `matrix` [rows, columns] into `out`. */
function transpose(out, matrix, rows, columns) {
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      out[column * rows + row] = matrix[row * columns + column];
    }
  }
}
